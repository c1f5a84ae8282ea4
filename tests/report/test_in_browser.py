"""The page of a run, in a browser: it draws, it moves, it asks nothing of anyone, and all can use it."""

import itertools

import pytest
from browser import Page, needs_chromium

pytestmark = [needs_chromium, pytest.mark.slow]

#: What is drawn of the scene, as a number for each picture, and the part that is not background.
PICTURE = """(() => {
  const pixels = report.viewer.pixels();
  let sum = 0, drawn = 0;
  for (let i = 0; i < pixels.length; i += 4) {
    sum = (sum * 31 + pixels[i] * 65536 + pixels[i + 1] * 256 + pixels[i + 2]) % 2147483647;
    drawn += pixels[i] !== pixels[0] || pixels[i + 1] !== pixels[1] || pixels[i + 2] !== pixels[2];
  }
  return { sum, part: drawn / (pixels.length / 4) };
})()"""

#: Controls without a name that a screen reader could say.
NAMELESS = """[...document.querySelectorAll("button, select, input, canvas, [role=img], a")].filter((one) =>
  !(one.getAttribute("aria-label") || one.textContent.trim() || one.labels?.[0]?.textContent.trim())
).map((one) => one.outerHTML)"""

#: Texts whose contrast with what is behind them is less than 4.5 (WCAG 2.1, AA).
PALE = """(() => {
  const rgb = (text) => text.match(/[\\d.]+/g).map(Number);
  const light = ([r, g, b]) => [r, g, b].map((v) => v / 255)
    .map((v) => (v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const behind = (one) => {
    for (; one; one = one.parentElement) {
      const colour = rgb(getComputedStyle(one).backgroundColor);
      if (colour.length === 3 || colour[3] > 0.5) return colour;
    }
    return [255, 255, 255];
  };
  const found = [];
  for (const one of document.querySelectorAll("body *:not(script):not(style):not(svg *)")) {
    const own = [...one.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
    if (!own || !one.checkVisibility()) continue;
    const [a, b] = [light(rgb(getComputedStyle(one).color)), light(behind(one))];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (ratio < 4.5) found.push(`${one.tagName} ${one.textContent.trim().slice(0, 30)} ${ratio.toFixed(2)}`);
  }
  return found;
})()"""

#: What is wider than the page, but for what scrolls by itself.
WIDE = """[...document.querySelectorAll("main *")].filter((one) => {
  if (one.closest(".table, .chart, nav, canvas, svg")) return false;
  return one.getBoundingClientRect().right > WIDTH + 1 && one.checkVisibility();
}).map((one) => one.outerHTML.slice(0, 80))"""


@pytest.fixture(scope="module")
def page(run_folder):
    with Page() as page:
        page.open((run_folder[0] / "report.html").as_uri())
        yield page


def picture(page):
    return page.value(PICTURE)


def choose(page, control, value):
    page.value(
        f"(() => {{ const one = document.getElementById('{control}'); one.value = '{value}';"
        "one.dispatchEvent(new Event(one.tagName === 'SELECT' ? 'change' : 'input', { bubbles: true })); })()"
    )


def tick(page, selector):
    page.value(f"document.querySelector(`{selector}`).click()")


def test_it_draws_and_the_slider_moves_the_muscles(page):
    first = picture(page)
    sides = page.value("[...document.querySelectorAll('[data-side]')].map((one) => one.textContent).join()")
    assert sides == "left,right,back,front"  # of +x, -x, +y, -y in LPS
    assert 0.03 < first["part"] < 0.9
    said = page.value("document.getElementById('readout').textContent")
    choose(page, "time", 4)
    assert picture(page)["sum"] != first["sum"]
    assert page.value("document.getElementById('readout').textContent") != said
    assert "20" in page.value("document.getElementById('time').getAttribute('aria-valuetext')")
    choose(page, "time", 0)
    assert picture(page)["sum"] == first["sum"], "the same frame is the same picture"


@pytest.mark.parametrize("colour", ["strain", "length", "depth", "stretch"])
def test_colours_change_and_have_a_scale(page, colour):
    choose(page, "time", 4)
    before = picture(page)
    assert page.value("document.getElementById('legend').hidden")
    choose(page, "colour-by", colour)
    assert picture(page)["sum"] != before["sum"]
    assert not page.value("document.getElementById('legend').hidden")
    ends = page.value("document.querySelector('#legend .high').textContent")
    assert ends.endswith("mm" if colour in ("length", "depth") else "%")
    choose(page, "colour-by", "muscle")
    choose(page, "time", 0)


def test_parts_are_switched_on_and_off(page):
    seen = {picture(page)["sum"]}
    choose(page, "show-bones", "hidden")
    seen.add(picture(page)["sum"])
    choose(page, "show-surfaces", "hidden")
    seen.add(picture(page)["sum"])
    tick(page, "#show-fibres")
    seen.add(picture(page)["sum"])
    assert len(seen) == 4
    assert picture(page)["part"] == 0.0
    choose(page, "show-bones", "solid")
    choose(page, "show-surfaces", "translucent")
    tick(page, "#show-fibres")
    assert picture(page)["sum"] in seen


def test_the_scene_turns_and_zooms_by_keys_and_by_the_pointer(page):
    page.value("document.getElementById('canvas').focus()")
    start = picture(page)["sum"]
    for key in ("ArrowLeft", "ArrowUp", "+"):
        before = picture(page)["sum"]
        page.key(key)
        assert picture(page)["sum"] != before, key
    page.key("0")
    assert picture(page)["sum"] == start
    page.value("document.getElementById('canvas').scrollIntoView({behavior: 'instant', block: 'center'})")
    x, y = page.value(
        "(() => { const box = canvas.getBoundingClientRect(); return [box.x + 200, box.y + 200]; })()"
    )
    for kind, at in (("mousePressed", x), ("mouseMoved", x + 60), ("mouseReleased", x + 60)):
        page.call("Input.dispatchMouseEvent", type=kind, x=at, y=y, button="left", buttons=1, clickCount=1)
    assert picture(page)["sum"] != start
    page.value("report.viewer.look(null)")


def test_curves_are_drawn_and_follow_what_is_chosen(page, run_folder):
    names = "(id) => document.getElementById(id).data.map((one) => one.name)"
    assert set(page.value(f"({names})('lengths')")) >= {"spindle", "second one"}
    arms = page.value("document.getElementById('arms').data.find((one) => one.name === 'spindle').y")
    found = run_folder[1].moment_arms()["spindle"]["knee_angle"]
    assert arms == pytest.approx(found.mean, abs=1e-3)
    tick(page, "input[name=which][value=spindle]")
    page.wait(f"({names})('arms').includes('Somebody1985, fibres')")
    tick(page, "input[name=which][value='']")
    page.wait(f"!({names})('arms').includes('Somebody1985, fibres')")


def test_it_plays_and_stops(page):
    tick(page, "#play")
    page.wait("report.viewer.state.frame > 1")
    assert page.value("document.getElementById('play').getAttribute('aria-pressed')") == "true"
    tick(page, "#play")
    at = page.value("report.viewer.state.frame")
    page.value("new Promise((done) => setTimeout(done, 300))")
    assert page.value("report.viewer.state.frame") == at
    choose(page, "time", 0)


def test_moment_arms_on_the_cards_are_those_of_the_frame(page, run_folder):
    arms = run_folder[1].moment_arms()["spindle"]["knee_angle"]
    for position in (0, 2):
        choose(page, "time", position)
        said = page.value("document.querySelector('[data-arm]').textContent").replace("\u2212", "-")
        assert float(said.split()[0]) == pytest.approx(arms.mean[position], abs=0.06)
        error = arms.errors["total"][position]
        assert said.endswith(f" mm at {arms.values[position]:.1f} deg, error {error:.1f} mm")
    choose(page, "time", 0)


def test_a_picture_is_saved_larger_and_says_what_it_shows(page):
    size = page.value(
        "(() => { const c = document.getElementById('canvas'); return [c.clientWidth, c.clientHeight]; })()"
    )
    choose(page, "colour-by", "strain")
    drawn = """(() => {
      const c = labelled(report.viewer, report.data, document.getElementById('canvas'), TIMES);
      const { data } = c.getContext("2d").getImageData(0, 0, c.width, c.height);
      const dark = (x, y, w, h) => {
        let sum = 0;
        for (let j = y; j < y + h; j++) for (let i = x; i < x + w; i++)
          sum += data[4 * (j * c.width + i)] < 60;
        return sum;
      };
      const scale = dark(0, c.height - 60 * TIMES, 300 * TIMES, 60 * TIMES);
      return [c.width, c.height, scale, dark(0, 0, 300 * TIMES, 40 * TIMES), data[4 * (c.width - 5)]];
    })()"""
    for times in (2, 4):
        width, height, scale, time, background = page.value(drawn.replace("TIMES", str(times)))
        assert [width, height] == [times * side for side in size]
        assert scale > 50 * times
        assert time > 50 * times
        assert background == 255
    choose(page, "colour-by", "muscle")


def test_it_prints_whole(page, tmp_path):
    before = page.value("document.querySelectorAll('details[open]').length")
    page.value("dispatchEvent(new Event('beforeprint'))")
    page.call("Emulation.setEmulatedMedia", media="print")
    page.resize(718, 900)
    assert page.value("document.querySelectorAll('details:not([open])').length") == 0
    charts = page.value(
        """[...document.querySelectorAll('.chart, .printed > div')].filter((c) => c.checkVisibility())
          .map((c) => [...["path[stroke]", ".names button"].map((part) => c.querySelectorAll(part).length),
           c.getBoundingClientRect().right])"""
    )
    drawn = page.value("report.data.curves.checks.filter((one) => !one.flat).length")
    assert len(charts) == 3 + max(drawn, 0)
    for lines, names, right in charts:
        assert lines >= 2
        assert names >= 2
        assert right <= 718
    cut = """[...document.querySelectorAll('.table')].filter((one) => one.scrollWidth > one.clientWidth + 1)
      .map((one) => one.getAttribute('aria-label'))"""
    assert page.value(cut) == []
    page.value("dispatchEvent(new Event('afterprint'))")
    page.call("Emulation.setEmulatedMedia", media="")
    page.resize(1440, 900)
    assert page.value("document.querySelectorAll('.printed').length") == 0
    assert page.value("document.querySelectorAll('details[open]').length") == before


@pytest.mark.parametrize("width", [390, 1440])
def test_it_is_readable_at_every_width(page, width):
    page.resize(width, 900)
    # A phone widens what it shows to what does not fit.
    page.wait(f"innerWidth === {width}")
    page.value("new Promise((done) => setTimeout(done, 300))")
    assert page.value(WIDE.replace("WIDTH", str(width))) == []
    assert page.value("document.documentElement.scrollWidth") <= width
    assert 0.02 < picture(page)["part"] < 0.9
    page.resize(1440, 900)


def test_every_control_has_a_name_and_every_text_can_be_read(page):
    assert page.value(NAMELESS) == []
    assert page.value(PALE) == []
    assert page.value("document.documentElement.lang") == "en"
    levels = page.value("[...document.querySelectorAll('h1, h2, h3')].map((one) => Number(one.tagName[1]))")
    assert levels[0] == 1
    assert all(after - before <= 1 for before, after in itertools.pairwise(levels))


def test_nothing_is_asked_of_the_network_and_nothing_is_complained_of(page, run_folder):
    """The last test of the page: after all that was done with it."""
    loaded = [address for address in page.requests if not address.startswith(("data:", "blob:"))]
    assert loaded == [(run_folder[0] / "report.html").as_uri()]
    assert page.errors == []
