"""How fast the gallery of many examples is in a browser: filter, sort, brush, scroll, expose, to the frame after.

`python benchmarks/gallery.py [COUNT]`. The examples are made up (figures and small pictures; nothing is rendered), and
times are taken by the browser: from the event to the frame after the one in which the page has changed, so that one
frame of waiting, 17 ms, is in each. Medians and the worst of 20; the bound is 100 ms. Beside them the processor time
of the page's thread, a mean over the 20, which a machine that is busy with other things does not move. Needs Chromium
and Playwright.
"""

import argparse
import importlib.util
import json
import os
import shutil
import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).parent.parent))

from dataset_builder.report.front.fill_page import script_json
from dataset_builder.report.front.pages import gallery_page
from dataset_builder.report.gallery.example_payload import example_payload
from tests.browser.conftest import QUIET
from tests.browser.made_up import gallery, lit_ball

CHROMIUM = os.environ.get("CHROMIUM") or shutil.which("chromium")
BOUND, REPEATS, SIZE = 100.0, 20, 512
LIGHT = ("i_s", "i_t", "s", "s_prime", "spec", "i_pbr")
"""Layers of the example whose exposure is changed, of SIZE x SIZE pixels."""
STEPS = {
    "filter": """place => { const select = document.querySelector("[data-filter=scene]");
        select.selectedIndex = place % select.options.length; return [select, "change"]; }""",
    "search": """place => { const field = document.querySelector("input[type=search]");
        field.value = ["chair", "", "kitchen spot", "heavy"][place % 4]; return [field, "input"]; }""",
    "sort": """place => { const select = document.querySelector("[data-sort]");
        select.selectedIndex = place % select.options.length; return [select, "change"]; }""",
    "brush": """place => { const plot = document.querySelector("[data-histogram=seconds] svg");
        const box = plot.getBoundingClientRect(), x = (share) => box.left + share * box.width, y = box.top + 5;
        const fire = (type, at) => plot.dispatchEvent(new PointerEvent(type, { clientX: x(at), clientY: y,
            pointerId: 1, bubbles: true }));
        plot.setPointerCapture = () => {}; fire("pointerdown", 0.1);
        return [plot, "pointermove", { clientX: x(0.3 + 0.03 * place), clientY: y, pointerId: 1, bubbles: true }]; }""",
    "scroll": """place => { window.scrollTo(0, (place % 2 ? 0.9 : 0.1) * document.body.scrollHeight * Math.random());
        return [window, "scroll"]; }""",
    "expose": """place => { const slider = document.querySelector("[aria-label='Exposure in stops']");
        slider.value = place / 10 - 1; return [slider, "input"]; }""",
}
"""What is done for the nth time: makes a change ready, and gives the event that tells the page of it."""
MEASURE = """async ([step, repeats]) => {
    const work = eval(step), frame = () => new Promise(requestAnimationFrame), times = [];
    for (let place = 0; place < repeats; place++) {
        await frame(); await frame();
        const start = performance.now(), [target, type, details] = work(place);
        target.dispatchEvent(details ? new PointerEvent(type, details) : new Event(type, { bubbles: true }));
        await frame(); await frame();
        times.push(performance.now() - start);
    }
    return times;
}"""


def measure(count: int) -> tuple[dict[str, list[float]], dict[str, float]]:
    """Milliseconds of each step, and of opening the page; and of processor time per step."""
    from playwright.sync_api import sync_playwright

    with TemporaryDirectory() as folder, sync_playwright() as playwright:
        file = Path(folder) / "gallery.html"
        payload = example_payload(dict.fromkeys(LIGHT, lit_ball(0, SIZE)["i_t"]), key=f"{0:08d}")
        element = f'<script type="application/json" data-key="{0:08d}">{script_json(payload)}</script>'
        file.write_text(gallery_page(gallery(count), element), encoding="utf-8")
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(QUIET))
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        devtools = page.context.new_cdp_session(page)
        devtools.send("Performance.enable", {"timeDomain": "threadTicks"})

        def busy() -> float:
            found = {one["name"]: one["value"] for one in devtools.send("Performance.getMetrics")["metrics"]}
            return 1000 * float(found["TaskDuration"])

        page.goto(file.as_uri())
        page.wait_for_selector("[data-card]")
        times = {"open": [page.evaluate("performance.getEntriesByType('navigation')[0].domComplete")]}
        work = {"open": busy()}
        for name, step in STEPS.items():
            if name == "expose":
                page.evaluate("location.hash = '#open=00000000'")
                page.wait_for_selector("canvas")
                page.wait_for_timeout(1000)
            before = busy()
            times[name] = page.evaluate(MEASURE, [f"({step})", REPEATS])
            work[name] = (busy() - before) / REPEATS
            page.evaluate("location.hash = '#'")
        browser.close()
    return times, work


def main() -> None:
    """Print the figures, and which steps' worst is over the bound."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("count", nargs="?", type=int, default=1000)
    count = parser.parse_args().count
    if importlib.util.find_spec("playwright") is None or CHROMIUM is None:
        print("nothing measured: it needs Playwright and Chromium (CHROMIUM is its path)")
        return
    times, work = measure(count)
    print(f"{count} examples; load {os.getloadavg()[0]:.1f}; ms: median and worst of {REPEATS}, processor time")
    for name, found in times.items():
        print(f"  {name:8} {median(found):6.1f} {max(found):6.1f} {work[name]:6.1f}")
    over = [name for name, found in times.items() if name != "open" and max(found) > BOUND]
    print(f"bound {BOUND:.0f}: " + (f"exceeded by {', '.join(over)}" if over else "kept by every one of them"))
    print(json.dumps({name: [round(time, 1) for time in found] for name, found in times.items()}))


if __name__ == "__main__":
    main()
