"""Opens a dashboard in a real Chromium at three widths, light and dark, and does with it what a person does.

    dashboard.py views|keys|work FOLDER LINK LIVE OTHER

`views` looks at every page, `keys` pauses and stops LIVE by the keyboard, `work` sorts, filters, annotates, compares, downloads and diagnoses. LINK is the address with its token; LIVE a run that goes on, OTHER one that is over. Looks for: requests to anywhere else, scripts of a
name that ran, a page wider than its window, what axe-core calls serious or critical, plots that stay empty, keys that do nothing.
Writes pictures into FOLDER. Prints one JSON document; every list in it should be empty but for `pictures`.
"""
import json
import shutil
import sys
from pathlib import Path
from urllib.parse import quote, urlsplit

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import sync_playwright

what, out, (link, live, other) = sys.argv[1], Path(sys.argv[2]), sys.argv[3:6]
base = f"{urlsplit(link).scheme}://{urlsplit(link).netloc}"
# A busy machine draws a page slowly: this is for one that never does.
WITHIN_MS = 180_000
chromium = shutil.which("chromium") or shutil.which("chromium-browser")
if not chromium:
    sys.exit("chromium is missing: tests/venv installs it")
faults, asked, ran, pictures = [], [], [], []
# Colours in a figure's canvas: a few of them mean that something is drawn.
DRAWN = "() => [...document.querySelectorAll('figure:not([hidden]) canvas')].map(c => { const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; return new Set(new Uint32Array(d.buffer)).size; })"
WIDER = "() => document.documentElement.scrollWidth - document.documentElement.clientWidth"


def settled(page, where):
    page.goto(f"{base}/#/{where}")
    page.wait_for_selector("h1")
    if where.startswith("page/"):
        page.frame_locator("iframe[title='report.html']").locator("h1").wait_for(timeout=WITHIN_MS)
    if where.startswith("compare/") or where == f"run/{quote(other)}":
        page.wait_for_selector(".report h1")
        # What is far down is made when a reader comes near.
        if page.locator(".below").count():
            page.locator(".below").scroll_into_view_if_needed()
            page.locator(".below").wait_for(state="detached")
        page.wait_for_timeout(500)
    elif where.startswith("run/"):
        page.wait_for_selector("dl.now dd", state="attached")
        page.wait_for_function("() => !document.querySelector('dl.now dd').textContent.startsWith('0 of 0')", timeout=WITHIN_MS)
        page.wait_for_timeout(1500)


def views(browser):
    for width in [360, 1200, 1600]:
        for scheme in ["light", "dark"]:
            page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
            page.set_default_timeout(WITHIN_MS)
            page.on("request", lambda r: asked.append(r.url) if not r.url.startswith((base, base.replace("http", "ws"), "data:", "about:")) else None)
            page.on("dialog", lambda d: (ran.append(d.message), d.dismiss()))
            page.on("console", lambda m: ran.append(m.text) if m.type == "error" else None)
            page.on("pageerror", lambda e: ran.append(str(e)))
            page.goto(link)
            page.wait_for_selector("table")
            places = {"runs": "", "live": f"run/{quote(live)}", "over": f"run/{quote(other)}", "report": f"page/{quote(other)}/report.html", "compare": f"compare/{quote(live)}/{quote(other)}"}
            for name, where in places.items():
                view = f"{name}-{width}-{scheme}"
                settled(page, where)
                if name in ("live", "over"):
                    drawn, words = page.evaluate(DRAWN), page.inner_text("main")
                    if len(drawn) != (7 if name == "live" else 6) or min(drawn) < 8:
                        faults.append(f"{view}: plots {drawn}")
                    if name == "over":
                        # The plan has five speeds, one that two digits would split: each has a mark of its own, and the key names all.
                        key = page.locator("#explore figcaption", has_text="passes;").first.inner_text()
                        faults.extend(f"{view}: {speed} mm/s in {key}" for speed in [5, 10, 12.5, 30, 80] if f": {speed} mm/s" not in key)
                        alike = page.evaluate("async () => { const { SERIES } = await import('/plots.js'); return SERIES.length - new Set(SERIES.map(s => `${s.kind} ${s.hollow}`)).size; }")
                        # The table of all passes is folded: its text is there and not shown.
                        if alike or "difference" not in page.locator("main details").first.text_content():
                            faults.append(f"{view}: {alike} marks alike, or no difference in the table")
                    if name == "live" and " um" in words:
                        faults.append(f"{view}: um for micrometres")
                    faults.extend(f"{view}: {bad}" for bad in ["NaN", "undefined", "No pass", "[object"] if bad in words)
                over = page.evaluate(WIDER)
                if over > 0:
                    faults.append(f"{view}: {over} px wider than the window")
                # A frame without scripts cannot be looked into; its page is looked at as a file, by pages.py.
                found = Axe().run(page, options={"iframes": False}).response["violations"]
                faults.extend([f"{view}: {v['id']}: {v['help']} ({v['nodes'][0]['target']})" for v in found if v["impact"] in ("serious", "critical")])
                page.screenshot(path=out / f"{view}.png", full_page=True)
                pictures.append(view)
                if view == "live-1600-light":
                    page.emulate_media(media="print")
                    page.pdf(path=out / "live.pdf", format="A4")
                    page.emulate_media(media="screen")
            page.close()


def work(browser):
    page = browser.new_page(viewport={"width": 1600, "height": 900})
    page.set_default_timeout(WITHIN_MS)
    page.on("console", lambda m: ran.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda e: ran.append(str(e)))
    page.goto(link)
    page.wait_for_selector("tbody tr")
    column = lambda n: page.eval_on_selector_all("tbody tr", f"rows => rows.map(r => r.cells[{n}].textContent)")
    first = lambda: column(2)
    if page.locator("tbody svg.thumb circle").count() < 20:
        faults.append("a run has no picture")
    for key, order in [("run", sorted(first())), ("run", sorted(first(), reverse=True))]:
        page.click(f"th button:text-is('{key}')")
        if first() != order:
            faults.append(f"sorted by {key}: {first()}")
    for words, want in [("PAD copied", ["copied"]), ("nothing-of-this", [])]:
        page.fill("#search", words)
        if first() != want:
            faults.append(f"filter {words}: {first()}")
    page.fill("#search", "")
    # Tags and a note: markup stays text, and they are there when the list is read again.
    page.click("tbody a:text-is('copied')")
    page.wait_for_selector(".report h1")
    page.fill("#tags", "dry, tip 3,dry")
    page.fill("#note", "<b onclick=x>second</b> try")
    page.click("button:text-is('Save')")
    page.wait_for_selector("text=written")
    for file in ["report", "points.csv"]:
        page.select_option("#file", label=file)
        with page.expect_download() as got:
            page.click("button:text-is('Download')")
        got.value.save_as(out / f"fetched-{file}")
    # An enlarged trace gets every recorded cycle of the run's folder, the other figures of time with it; the whole is that of the page again.
    page.locator(".below").scroll_into_view_if_needed()
    plots = page.locator("#explore figure .plot[data-points]")
    plots.first.wait_for()
    points = lambda: [int(n) for n in plots.evaluate_all("all => all.map(p => p.dataset.points)")]
    before, caption = points(), page.locator("#explore figure", has=page.locator("h2", has_text="Forces")).locator("figcaption")
    plots.first.focus()
    for _ in range(6):
        page.keyboard.press("+")
    page.wait_for_function("() => [...document.querySelectorAll('#explore figcaption')].some(c => c.textContent.includes('every recorded cycle'))")
    if not all(n > 400 for n in points()):
        faults.append(f"enlarged: {points()} points after {before}: {caption.inner_text()}")
    page.screenshot(path=out / "enlarged.png", full_page=True)
    page.keyboard.press("0")
    page.wait_for_function(f"() => [...document.querySelectorAll('#explore .plot[data-points]')].every((p, i) => p.dataset.points === String({before}[i]))")
    page.click("button:text-is('Diagnose')")
    page.wait_for_selector("button:text-is('Diagnose again')")
    words = page.inner_text("main")
    faults.extend(f"the page says {bad}" for bad in ["null", "undefined", "NaN"] if bad in words)
    faults.extend(f"after the diagnosis: no {one}" for one in ["diagnosis.html", "corrected-model.toml or next-plan.toml"] if not any(name in words for name in one.split(" or ")))
    page.screenshot(path=out / "diagnosed.png", full_page=True)
    page.goto(f"{base}/#/")
    page.wait_for_selector("tbody tr")
    page.fill("#search", "tip 3")
    if first() != ["copied"] or "<b onclick=x>second</b> try" not in page.inner_text("tbody") or "no diagnosis" in page.inner_text("tbody"):
        faults.append(f"the list after the notes: {page.inner_text('tbody')}")
    page.fill("#search", "")
    for box in page.locator("tbody input[type=checkbox]").all():
        box.check()
    page.click("button:text-is('Compare the chosen runs')")
    page.wait_for_selector(".report h1")
    if "3 runs" not in page.inner_text("h1") or page.locator("#explore figure canvas").count() != 2:
        faults.append(f"compared: {page.inner_text('h1')}")
    page.screenshot(path=out / "compared.png", full_page=True)
    page.select_option("#by", "day")
    page.wait_for_selector("p[role=alert]:has-text('one group')")
    # A refusal is an answer that the browser logs.
    ran[:] = [one for one in ran if "422" not in one]
    pictures.extend(["diagnosed", "compared"])
    page.close()


def keys(browser):
    # The whole way by the keyboard: to the run, and its stop.
    page = browser.new_page()
    page.set_default_timeout(WITHIN_MS)
    page.goto(link)
    page.wait_for_selector("table a")
    seen = []
    for _ in range(60):
        page.keyboard.press("Tab")
        seen.append(page.evaluate("() => document.activeElement.textContent || document.activeElement.id"))
        if seen[-1] == live:
            break
    else:
        faults.append(f"the keyboard does not reach the run: {seen}")
    page.keyboard.press("Enter")
    page.wait_for_selector("button.stop:not([disabled])", timeout=WITHIN_MS)
    for _ in range(20):
        page.keyboard.press("Tab")
        if page.evaluate("() => document.activeElement.textContent") == "Pause":
            break
    else:
        faults.append("the keyboard does not reach the pause")
    page.keyboard.press("Enter")
    try:
        page.wait_for_function("() => document.querySelector('.state').textContent === 'paused'", timeout=WITHIN_MS)
        page.keyboard.press("Enter")
        page.wait_for_function("() => document.querySelector('.state').textContent === 'armed'", timeout=WITHIN_MS)
        page.keyboard.press("Shift+Tab")
        page.keyboard.press("Enter")
        page.wait_for_function("() => document.querySelector('.state').textContent === 'stopped'", timeout=WITHIN_MS)
    except Exception as why:
        faults.append(f"keys: {why}; {page.inner_text('main')[:600]}")
    page.screenshot(path=out / "stopped.png", full_page=True)


with sync_playwright() as p:
    browser = p.chromium.launch(executable_path=chromium, timeout=WITHIN_MS, args=["--no-sandbox", "--disable-gpu"])
    {"views": views, "keys": keys, "work": work}[what](browser)
    browser.close()
print(json.dumps({"faults": faults, "asked": asked, "ran": ran, "pictures": pictures}))
