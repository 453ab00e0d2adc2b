"""Opens pages in a real Chromium at three widths, light, dark and in print, and says what is wrong with them.

    pages.py FOLDER PAGE...

Looks for: requests to anywhere, scripts that ran, a page wider than its window, figures without words, letters too small to read, what
axe-core calls serious or critical, what the keyboard does not reach. Writes pictures and a PDF into FOLDER. Prints one JSON document.
"""
import json
import shutil
import sys
from pathlib import Path

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import sync_playwright

WIDTHS = [360, 1200, 1600]
# What a page says about itself in the browser: its overflow, its figures and the smallest letter that is shown, in CSS pixels.
LOOK = """() => {
  const shown = e => e.getClientRects().length > 0;
  const figures = [...document.querySelectorAll('svg')].filter(shown);
  const letters = figures.flatMap(svg => {
    const k = svg.getBoundingClientRect().width / svg.viewBox.baseVal.width;
    return [...svg.querySelectorAll('text')].map(t => k * parseFloat(t.getAttribute('font-size')));
  });
  return {
    overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth,
    figures: figures.length,
    nameless: figures.filter(s => !(s.getAttribute('aria-label') || '').trim()).length,
    smallest: letters.length ? Math.min(...letters) : null,
  };
}"""



def explored(browser, path):
    """What is wrong with the part of a run's page that is worked with: hover, click, legend, files; and the page without scripts."""
    page, faults = browser.new_page(viewport={"width": 1200, "height": 900}), []
    page.set_default_timeout(WITHIN_MS)
    page.on("pageerror", lambda e: faults.append(str(e)))
    page.goto(path.as_uri())
    over = page.locator("#explore .u-over").first
    over.scroll_into_view_if_needed()
    box, tip = over.bounding_box(), None
    for step in range(2, 98):
        for up in range(4, 96, 6):
            page.mouse.move(box["x"] + box["width"] * step / 100, box["y"] + box["height"] * up / 100)
            tip = page.evaluate("() => document.querySelector('.tip:not([hidden])')?.textContent")
            if tip:
                break
        if tip:
            break
    number = (tip or "pass none:").split(":")[0].removeprefix("pass ")
    page.mouse.down()
    page.mouse.up()
    if page.evaluate("() => document.getElementById('pass').value") != number:
        faults.append(f"a click on '{tip}' does not show its forces")
    if f"pass {number}:" not in page.locator("figure", has=page.locator("h2", has_text="Forces")).inner_text():
        faults.append(f"the forces are not said to be those of pass {number}")
    rows = []
    for _ in range(2):
        with page.expect_download() as got:
            page.locator("#explore button", has_text="CSV").first.click()
        rows.append(Path(got.value.path()).read_text().splitlines())
        page.locator("#explore button[aria-pressed]").first.click()
    if not (len(rows[0]) > len(rows[1]) > 1 and {"point", "time_s", "w_um"} <= set(rows[0][0].split(","))):
        faults.append(f"the legend hides nothing: {len(rows[0])} and {len(rows[1])} rows")
    # By the keyboard: a figure is enlarged, moved, and whole again.
    plot = page.locator("#explore figure", has=page.locator("h2", has_text="Forces")).locator(".plot")
    plot.focus()
    # The focus is shown from the first key on.
    page.keyboard.press("0")
    page.wait_for_timeout(300)
    shown = lambda: plot.screenshot()
    views = [shown()]
    for key in ["+", "ArrowRight", "0"]:
        page.keyboard.press(key)
        page.wait_for_timeout(300)
        views.append(shown())
    if views[1] in views[0:1] + views[2:] or views[3] != views[0]:
        faults.append("the keys +, ArrowRight and 0 do not enlarge, move and restore the forces")
    with page.expect_download() as got:
        page.locator("button", has_text="SVG").first.click()
    if not Path(got.value.path()).read_text().startswith("<svg"):
        faults.append("the figure's file is not an SVG")
    page.close()
    quiet = browser.new_context(java_script_enabled=False).new_page()
    quiet.goto(path.as_uri())
    if quiet.locator("#explore").is_visible() or not quiet.locator("svg").first.is_visible():
        faults.append("without scripts the figures do not stand")
    quiet.close()
    return faults


def followed(browser, path):
    """What is wrong with the maps of a verdict's page: a mark leads to its pass, also without scripts, and the plan is handed out."""
    page, faults = browser.new_context(java_script_enabled=False, viewport={"width": 1200, "height": 900}, accept_downloads=True).new_page(), []
    page.set_default_timeout(WITHIN_MS)
    page.goto(path.as_uri())
    for mark in [page.locator(".map a").first, page.locator(".map a").last]:
        row = page.locator(mark.get_attribute("href"))
        if row.is_visible():
            page.locator("summary", has_text="All").click()
        mark.click()
        row.wait_for(state="visible")
        if not mark.get_attribute("title").startswith(f"pass {row.locator('th').inner_text()}: "):
            faults.append(f"{mark.get_attribute('title')} leads to {row.inner_text()}")
    if page.locator("a[download]").count():
        with page.expect_download() as got:
            page.locator("a[download]").first.click()
        if "[[series]]" not in Path(got.value.path()).read_text() or got.value.suggested_filename != "next-plan.toml":
            faults.append(f"the plan is {got.value.suggested_filename}")
    page.close()
    return faults


out, pages = Path(sys.argv[1]), [Path(p).resolve() for p in sys.argv[2:]]
# A busy machine draws a page slowly: this is for one that never does.
WITHIN_MS = 180_000
chromium = shutil.which("chromium") or shutil.which("chromium-browser")
if not chromium:
    sys.exit("chromium is missing: tests/venv installs it")
axe, seen = Axe(), []
with sync_playwright() as p:
    browser = p.chromium.launch(executable_path=chromium, timeout=WITHIN_MS, args=["--no-sandbox", "--disable-gpu"])
    for path in pages:
        tried = explored(browser, path) if path.name == "report.html" else followed(browser, path) if path.name == "verdict.html" else []
        for width in WIDTHS:
            for scheme in ["light", "dark"]:
                page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
                page.set_default_timeout(WITHIN_MS)
                asked, ran = [], []
                page.on("request", lambda r: asked.append(r.url))
                page.on("dialog", lambda d: (ran.append(d.message), d.dismiss()))
                page.on("console", lambda m: ran.append(m.text) if m.type == "error" else None)
                page.goto(path.as_uri())
                faults = [
                    f"{v['id']}: {v['help']} ({len(v['nodes'])} places, first {v['nodes'][0]['target']})"
                    for v in axe.run(page).response["violations"]
                    if v["impact"] in ("serious", "critical")
                ]
                look = page.evaluate(LOOK)
                page.screenshot(path=out / f"{path.stem}-{width}-{scheme}.png", full_page=True)
                asked = [url for url in asked if url != path.as_uri() and not url.startswith("data:")]
                # On paper nothing is folded.
                page.emulate_media(media="print")
                unprinted = page.evaluate(
                    "() => [...document.querySelectorAll('details td, details li, details p')].filter((e) => !e.checkVisibility()).length"
                )
                page.emulate_media(media="screen")
                # By the keyboard alone: what folds opens, what scrolls has the focus.
                opened = page.evaluate("() => [...document.querySelectorAll('details')].length")
                for _ in range(120):
                    page.keyboard.press("Tab")
                    if page.evaluate("() => document.activeElement.matches('details:not([open]) > summary')"):
                        page.keyboard.press("Enter")
                folded = page.evaluate("() => [...document.querySelectorAll('details:not([open])')].length")
                seen.append(
                    dict(page=path.name, width=width, scheme=scheme, axe=faults, tried=tried, asked=asked, ran=ran,
                         details=opened, folded=folded, unprinted=unprinted, **look)
                )
                page.close()
        page = browser.new_page()
        page.set_default_timeout(WITHIN_MS)
        page.goto(path.as_uri())
        page.pdf(path=out / f"{path.stem}.pdf", format="A4", prefer_css_page_size=True)
        page.close()
    browser.close()
print(json.dumps(seen))
