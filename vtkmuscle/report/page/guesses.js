/* What the page of a draft does: draws the scene, and writes the scene with the accepted guesses. */

/* The text of a scene in which guesses count as given: without their confidences. */
function withAccepted(text, guesses) {
  let lines = text.split("\n");
  for (const [confidence, what, value, why] of guesses) {
    const note = `# confidence ${confidence}: ${why}`;
    lines = lines.filter((line) => !line.startsWith(`"${what}" = `));
    lines = lines.map((line) => (line.startsWith(note) ? `# accepted: ${why}` : line));
    if (!what.endsWith(".attachments")) continue;
    const role = `{ role = "${value.split(":")[0]}"`;
    let table = "";
    lines = lines.map((line) => {
      if (line.startsWith("[")) table = line;
      const own = `${table.slice(1, -1)}.attachments` === what && line.trim().startsWith(role);
      return own ? line.replace(/, confidence = [\d.]+/, "") : line;
    });
  }
  return lines.join("\n");
}

async function begin() {
  const data = JSON.parse(document.getElementById("data").textContent);
  const block = await inflated("arrays");
  const canvas = document.getElementById("canvas");
  const viewer = makeViewer(canvas, data.scene, block);
  if (viewer) aroundScene(viewer, data.scene.mm, canvas);
  else document.getElementById("no-webgl").hidden = false;
  for (const button of document.querySelectorAll("[data-alone]")) {
    button.addEventListener("click", () => {
      for (const box of document.querySelectorAll("[data-muscle]")) {
        if (box.checked !== (box.dataset.muscle === button.dataset.alone)) box.click();
      }
      document.getElementById("scene").scrollIntoView({ behavior: "smooth" });
    });
  }
  const boxes = [...document.querySelectorAll("[data-guess]")];
  const text = () => withAccepted(data.text, boxes.filter((box) => box.checked).map((box) => data.guesses[box.dataset.guess]));
  const button = document.getElementById("save");
  for (const box of boxes) box.addEventListener("change", () => (button.disabled = !boxes.some((one) => one.checked)));
  button.addEventListener("click", () => save(URL.createObjectURL(new Blob([text()], { type: "text/plain" })), "scene.toml"));
  window.draft = { viewer, text };
  document.documentElement.dataset.ready = "yes";
}

begin().catch((error) => {
  const place = document.getElementById("failed");
  place.hidden = false;
  place.append(` ${error}`);
  throw error;
});
