"""The page of a run, in a browser: it draws, it moves, it asks nothing of anyone, and all can use it."""

import itertools

import numpy as np
import pytest
from browser import Page, needs_chromium

pytestmark = needs_chromium

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
    assert 0.03 < first["part"] < 0.9
    said = page.value("document.getElementById('readout').textContent")
    choose(page, "time", 4)
    last = picture(page)
    assert last["sum"] != first["sum"]
    assert page.value("document.getElementById('readout').textContent") != said
    assert "20" in page.value("document.getElementById('time').getAttribute('aria-valuetext')")
    choose(page, "time", 0)
    assert picture(page)["sum"] == first["sum"], "the same frame is the same picture"


def test_what_is_drawn_is_where_the_result_has_it(page, run_folder):
    """Muscles alone: their outline on the canvas is as wide as the points of the frame are."""
    import numpy as np

    from vtkmuscle.data.arrays import points_of

    result = run_folder[1]
    for box in ("show-bones", "show-surfaces"):
        choose(page, box, "hidden" if box == "show-bones" else "solid")
    page.value("report.viewer.look([1, 0, 0])")
    choose(page, "time", 4)
    columns = page.value("""(() => {
      const pixels = report.viewer.pixels(), { width, height } = document.getElementById("canvas");
      let low = Infinity, high = -1;
      for (let i = 0; i < width * height; i++) {
        if (pixels[4 * i] !== pixels[0]) { low = Math.min(low, i % width); high = Math.max(high, i % width); }
      }
      const { focus } = report.viewer.camera, half = heightOf(report.viewer.camera, width / height);
      return [low, high + 1].map((x) => focus[1] + ((x / width) * 2 - 1) * half * (width / height));
    })()""")
    points = np.vstack([points_of(result.muscle(name, frame=4)) for name in result.muscle_names])
    for name in ("show-bones", "show-surfaces"):
        choose(page, name, "solid" if name == "show-bones" else "translucent")
    page.value("report.viewer.look(null)")
    choose(page, "time", 0)
    assert columns == pytest.approx([points[:, 1].min(), points[:, 1].max()], abs=0.6)


@pytest.mark.parametrize("towards", ["null", "[1, 0, 0]", "[0, -1, 0]", "[0.001, 0, 1]"])
def test_a_view_cuts_nothing_off(page, towards):
    """Muscles and bones of the first frame are inside the canvas, and fill it in one direction."""
    page.value(f"report.viewer.look({towards})")
    rim, width, height = page.value("""(() => {
      const pixels = report.viewer.pixels(), { width, height } = document.getElementById("canvas");
      const there = (x, y) => pixels[4 * (y * width + x)] !== 243;
      let low = [width, height], high = [-1, -1];
      for (let y = 0; y < height; y++) for (let x = 0; x < width; x++) if (there(x, y)) {
        low = [Math.min(low[0], x), Math.min(low[1], y)]; high = [Math.max(high[0], x), Math.max(high[1], y)];
      }
      return [[...low, width - 1 - high[0], height - 1 - high[1]], width, height];
    })()""")
    page.value("report.viewer.look(null)")
    assert min(rim) > 2
    assert min((rim[0] + rim[2]) / width, (rim[1] + rim[3]) / height) < 0.35


def test_a_measure_that_stays_is_said_and_not_drawn(page):
    shown = """["checks", "check-words"].map((id) => document.getElementById(id).checkVisibility())"""
    flat = page.value(
        "Object.fromEntries(report.data.curves.checks.map((one) => [one.key, Boolean(one.flat)]))"
    )
    assert {True, False} <= set(flat.values())
    for key, stays in flat.items():
        choose(page, "check", key)
        assert page.value(shown) == [not stays, stays], key


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


def test_the_slider_is_moved_by_keys(page):
    page.value("document.getElementById('time').focus()")
    page.key("ArrowRight")
    assert page.value("report.viewer.state.frame") == 1
    page.key("Home")
    assert page.value("report.viewer.state.frame") == 0


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


CHART = """const chart = document.getElementById('lengths'), svg = chart.querySelector('svg');
  const box = chart.getBoundingClientRect()"""
CURSOR = (
    "document.getElementById('lengths').value(document.querySelector('#lengths .cursor').x1.baseVal.value)"
)


def drag(page, chart, start, end):
    """Press the mouse at a place on a chart's axis, and let it go at another."""
    places = {"pointerdown": start, "pointerup": end}
    events = "; ".join(
        f"document.querySelector('#{chart} svg').dispatchEvent(new PointerEvent('{name}', "
        f"{{ bubbles: true, pointerType: 'mouse', clientX: box.left + chart.X({place}) }}))"
        for name, place in places.items()
    )
    page.value(f"{{ {CHART.replace('lengths', chart)}; {events}; null }}")


def test_a_click_on_a_curve_shows_that_frame(page):
    drag(page, "lengths", 14.0, 14.0)
    assert page.value("report.viewer.state.frame") == 3
    page.wait(f"{CURSOR} === 15")
    choose(page, "time", 0)


def test_the_pointer_shows_values_and_a_drag_zooms(page):
    move = "new PointerEvent('pointermove', { bubbles: true, clientX: box.left + chart.X(5) })"
    page.value(f"{{ {CHART}; svg.dispatchEvent({move}); null }}")
    words = page.value("[...document.querySelectorAll('#lengths .tip div')].map((one) => one.textContent)")
    mean = page.value("document.getElementById('lengths').data.find((one) => one.name === 'spindle').y[1]")
    assert words[0] == "5"
    assert f"spindle: {mean:.4g}" in words
    drag(page, "lengths", 4.0, 12.0)
    assert page.value("document.getElementById('lengths').zoom") == pytest.approx([4.0, 12.0])
    page.value(f"{{ {CHART}; svg.dispatchEvent(new MouseEvent('dblclick', {{ bubbles: true }})); null }}")
    assert page.value("document.getElementById('lengths').zoom") is None
    assert page.value("report.viewer.state.frame") == 0


def test_a_name_below_a_chart_hides_its_curve(page):
    curves = "document.querySelectorAll('#lengths svg path').length"
    before = page.value(curves)
    buttons = "[...document.querySelectorAll('#lengths .names button')]"
    name = f"{buttons}.find((one) => one.textContent === 'spindle')"
    page.value(f"{name}.click()")
    assert page.value(curves) == before - 1
    assert page.value(f"{name}.getAttribute('aria-pressed')") == "false"
    page.value(f"{name}.click()")
    assert page.value(curves) == before


def test_it_plays_and_stops(page):
    tick(page, "#play")
    page.wait("report.viewer.state.frame > 1")
    assert page.value("document.getElementById('play').getAttribute('aria-pressed')") == "true"
    tick(page, "#play")
    at = page.value("report.viewer.state.frame")
    page.value("new Promise((done) => setTimeout(done, 300))")
    assert page.value("report.viewer.state.frame") == at
    choose(page, "time", 0)


def test_a_link_leads_to_a_frame_and_follows_the_slider(page, run_folder):
    page.value("(() => { location.hash = '#frame=2'; })()")
    page.wait("report.viewer.state.frame === 2")
    choose(page, "time", 1)
    assert page.value("location.hash") == "#frame=1"
    choose(page, "time", 0)


def test_moment_arms_on_the_cards_are_those_of_the_frame(page, run_folder):
    result = run_folder[1]
    arms = result.moment_arms()["spindle"]["knee_angle"]
    for position in (0, 2):
        choose(page, "time", position)
        said = page.value("document.querySelector('[data-arm]').textContent").replace("\u2212", "-")
        assert float(said.split()[0]) == pytest.approx(arms.mean[position], abs=0.06)
        assert said.endswith(f"at {arms.values[position]:.1f} deg")
    choose(page, "time", 0)


def test_a_chart_is_saved_as_numbers(page, run_folder):
    rows = page.value("csvOf(document.getElementById('lengths'))").splitlines()
    assert rows[0] == 'series,knee angle [deg],"length, bone to bone [mm]",low,high'
    means = [float(row.split(",")[2]) for row in rows if row.startswith("spindle,")]
    np.testing.assert_allclose(means, run_folder[1].lengths["spindle"].mean(axis=1), rtol=1e-4)
    bands = [row.split(",") for row in rows if row.startswith("spindle: all paths,")]
    np.testing.assert_allclose(
        [float(row[4]) for row in bands], run_folder[1].lengths["spindle"].max(axis=1), rtol=1e-4
    )


def test_one_spike_does_not_flatten_an_axis(page):
    parts = """[{ y: Array.from({ length: 40 }, (_, i) => 30 + i % 3) },
      { low: Array(40).fill(25), high: [...Array(39).fill(40), 800] }]"""
    low, high = page.value(f"rangeOf({parts})")
    assert low <= 25
    assert 40 <= high < 50
    assert page.value("rangeOf([{ y: [1, null, 3] }])") == pytest.approx([0.88, 3.12])


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


def test_views_have_the_names_of_the_body_where_its_front_is_said(page):
    choose(page, "front", "0 -1")
    buttons = "[...document.querySelectorAll('[data-side]')]"
    views = f"Object.fromEntries({buttons}.map((one) => [one.dataset.side, one.textContent]))"
    # Of somebody who looks along -y with z up, the left hand is at +x.
    assert page.value(views) == {"1 0": "left", "-1 0": "right", "0 1": "back", "0 -1": "front"}
    choose(page, "front", "")
    assert page.value(views)["1 0"] == "+x"


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
