#!/usr/bin/env python3
"""Draws docs/pictures/rig.svg and docs/pictures/cycle.svg. With --check it compares and writes nothing.

The cycle is that of the spring-slider (Eqs. 6 to 15) at the paper's point, computed here in a few lines: its relative friction must be
that of `muprime model point`.
"""

import math
import sys
from pathlib import Path

PICTURES = Path(__file__).parent.parent / "docs" / "pictures"
INK, GREY, BLUE, RED, SHADE = "#1f2933", "#7b8794", "#0b6e99", "#b54708", "#e6f1f5"
FONT = "font-family='system-ui, sans-serif'"


def page(width, height, body, title):
    return (
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width} {height}' width='{width}' height='{height}' role='img'>\n"
        f"<title>{title}</title>\n<rect width='{width}' height='{height}' fill='#ffffff'/>\n" + "\n".join(body) + "\n</svg>\n"
    )


def text(x, y, words, anchor="middle", size=14, fill=INK, weight="normal"):
    return f"<text x='{x:.1f}' y='{y:.1f}' {FONT} font-size='{size}' fill='{fill}' text-anchor='{anchor}' font-weight='{weight}'>{words}</text>"


def line(points, stroke=INK, width=1.5, dash="", end=""):
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    dash = f" stroke-dasharray='{dash}'" if dash else ""
    end = f" marker-end='url(#{end})'" if end else ""
    return f"<polyline points='{path}' fill='none' stroke='{stroke}' stroke-width='{width}'{dash}{end}/>"


def box(x, y, w, h, words, fill="#f5f7fa", stroke=GREY, weight="600"):
    drawn = [f"<rect x='{x}' y='{y}' width='{w}' height='{h}' rx='4' fill='{fill}' stroke='{stroke}'/>"]
    first = y + h / 2 + 5 - 9 * (len(words) - 1)
    return drawn + [text(x + w / 2, first + 18 * i, word, size=13, weight=weight if i == 0 else "normal") for i, word in enumerate(words)]


def arrows():
    return "<defs>" + "".join(
        f"<marker id='{name}' viewBox='0 0 8 8' refX='7' refY='4' markerWidth='7' markerHeight='7' orient='auto-start-reverse'>"
        f"<path d='M0,0 L8,4 L0,8 z' fill='{colour}'/></marker>"
        for name, colour in (("ink", INK), ("blue", BLUE), ("red", RED))
    ) + "</defs>"


def rig():
    """The bench at the left, the instruments in the middle, muprime at the right."""
    body = [arrows()]
    # Base, force sensor, plate with its transducers.
    body += box(60, 330, 300, 34, ["two-axis force sensor"])
    body += box(60, 282, 300, 22, [""], "#d9e2ec")
    body.append(text(210, 298, "plate, 20 to 100 kHz", size=13))
    body += [f"<rect x='{x}' y='304' width='46' height='12' fill='{BLUE}'/>" for x in (70, 304)]
    body += [line([(x, 316), (x, 330)], GREY, 4) for x in (150, 270)]
    body.append(text(40, 297, "w", size=15, fill=BLUE, weight="600"))
    body.append(f"<line x1='50' y1='272' x2='50' y2='314' stroke='{BLUE}' stroke-width='1.5' marker-start='url(#blue)' marker-end='url(#blue)'/>")
    # Fingertip on its holder.
    body.append("<path d='M172,190 L172,240 C172,272 188,282 210,282 C232,282 248,272 248,240 L248,190 z' fill='#f7d9c4' stroke='#b98b6b'/>")
    body.append(text(210, 245, "fingertip", size=13))
    body += box(150, 148, 120, 42, ["stage", "load and speed"])
    body.append(line([(285, 230), (345, 230)], RED, 2, end="red"))
    body.append(text(315, 221, "speed U", size=13, fill=RED))
    body.append(line([(140, 205), (140, 268)], RED, 2, end="red"))
    body.append(text(132, 240, "load F", "end", 13, RED))
    # Instruments.
    body += box(430, 66, 150, 44, ["supply relay", "cuts the mains"], "#fdf0e6", RED)
    body += box(430, 148, 150, 44, ["amplifier", "drives the plate"])
    body += box(430, 230, 150, 44, ["stage controller"])
    body += box(430, 325, 150, 44, ["sensor electronics"])
    body.append(line([(505, 110), (505, 146)], RED, 2, end="red"))
    body.append(line([(430, 180), (395, 180), (395, 310), (352, 310)], BLUE, 2, end="blue"))
    body.append(line([(430, 245), (380, 245), (380, 165), (272, 165)], INK, 1.5, end="ink"))
    body.append(line([(360, 347), (428, 347)], INK, 1.5, end="ink"))
    # The computer.
    body.append(f"<rect x='690' y='60' width='180' height='320' rx='6' fill='{SHADE}' stroke='{BLUE}'/>")
    body.append(text(780, 88, "muprime", size=17, fill=BLUE, weight="700"))
    for i, words in enumerate(["safety core", "control loop, 1 kHz", "model of the contact", "record and report", "diagnosis"]):
        body += box(705, 104 + 52 * i, 150, 36, [words], "#ffffff", weight="normal")
    for y, words, towards in ((88, "off", False), (170, "w, frequency", False), (252, "speed, load", False), (347, "forces", True)):
        ends = [(688, y), (582, y)]
        body.append(line(ends[::-1] if towards else ends, INK, 1.5, end="ink"))
        body.append(text(635, y - 7, words, size=12))
    body.append(text(635, 398, "Modbus, CAN, serial lines, UDP", size=13, fill=GREY))
    body.append(text(210, 398, "the bench (or the virtual rig)", size=13, fill=GREY))
    body.append(text(465, 32, "A tribometer with an ultrasonic plate, and what muprime reads and commands", size=17, weight="600"))
    return page(930, 420, body, "Sketch of a rig: fingertip on a vibrating plate, instruments, and muprime")


def cycle(w=2e-6, f=27.5e3, u=0.02, load=0.25, mu0=0.5, kn=3.9e6, kl=1.5e6, steps=20000):
    """Plate, normal force and lateral force of the massless slider over one period: (times in periods, ...), and mu'."""
    period = 1 / f
    plate = [w / 2 * math.sin(2 * math.pi * i / steps) for i in range(steps)]
    low, high = -w, 2 * load / kn + w
    for _ in range(60):
        # The skin's rest level, so that the mean normal force is the load.
        rest = (low + high) / 2
        low, high = (rest, high) if sum(max(0.0, kn * (z + rest)) for z in plate) / steps < load else (low, rest)
    normal = [max(0.0, kn * (z + rest)) for z in plate]
    start = next(i for i in range(steps) if normal[i - 1] == 0.0 and normal[i] > 0.0)
    lateral, stretch, slips_at = [0.0] * steps, 0.0, None
    for n in range(steps):
        i = (start + n) % steps
        stretch = 0.0 if normal[i] == 0.0 else stretch + kl * u * period / steps
        if stretch >= mu0 * normal[i] and normal[i] > 0.0:
            slips_at = n if slips_at is None and n > 5 else slips_at
            stretch = mu0 * normal[i]
        lateral[i] = stretch
    contact = sum(x > 0.0 for x in normal) / steps
    return plate, normal, lateral, -rest, start / steps, contact, slips_at / steps, sum(lateral) / steps / (mu0 * load)


def vibration():
    plate, normal, lateral, rest, start, contact, stick, mu = cycle()
    # What `muprime model point` answers for this point.
    assert abs(mu - 0.2957) < 2e-3 and abs(contact - 0.276) < 2e-3, (mu, contact)
    left, wide, n = 140, 560, len(plate)
    body = [arrows(), text(420, 30, "One period of the vibration: 36 µs at 27.5 kHz", size=17, weight="600")]
    x = lambda share: left + wide * share
    # Contact lies within the period as it is drawn.
    body.append(f"<rect x='{x(start):.1f}' y='50' width='{wide * contact:.1f}' height='480' fill='{SHADE}'/>")
    body.append(text(x(start + contact / 2), 66, "contact", size=13, fill=BLUE))

    def panel(y, h, label, unit, top, curves):
        low, high = top
        at = lambda value: y + h - h * (value - low) / (high - low)
        body.append(line([(left, y), (left, y + h), (left + wide, y + h)], GREY))
        body.append(text(left - 36, y + h / 2 - 4, label, "end", 14, INK, "600"))
        body.append(text(left - 36, y + h / 2 + 14, unit, "end", 12, GREY))
        for value in top:
            body.append(text(left - 6, at(value) + 4, f"{value:g}", "end", 11, GREY))
        for values, colour, dash, width in curves:
            body.append(line([(x(i / n), at(values[i])) for i in range(0, n, n // 250)] + [(x(1), at(values[0]))], colour, width, dash))
        return at

    skin = [max(z, rest) * 1e6 for z in plate]
    at = panel(80, 120, "plate, skin", "µm", (-1.2, 1.2), [([z * 1e6 for z in plate], INK, "", 2), (skin, RED, "6 4", 2)])
    body.append(text(x(0.62), at(rest * 1e6) - 7, "skin, where the plate leaves it", size=13, fill=RED))
    body.append(text(x(0.75), at(-0.25), "plate, stroke w = 2 µm", "middle", 13))
    at = panel(240, 120, "normal force", "N", (0, 1.5), [(normal, INK, "", 2)])
    body.append(line([(x(0), at(0.25)), (x(1), at(0.25))], BLUE, 1.5, "4 4"))
    body.append(text(x(0.99), at(0.25) - 6, "its mean is the load, 0.25 N", "end", 13, BLUE))
    limit = [0.5 * force for force in normal]
    at = panel(400, 120, "lateral force", "N", (0, 0.75), [(limit, GREY, "5 4", 1.5), (lateral, RED, "", 2.5)])
    mean = sum(lateral) / n
    body.append(line([(x(0), at(mean)), (x(1), at(mean))], BLUE, 1.5, "4 4"))
    body.append(text(x(0.99), at(mean) - 6, f"its mean: {100 * mu:.0f} % of Coulomb friction alone", "end", 13, BLUE))
    body.append(text(x(start + contact) + 8, at(0.55), "limit of Coulomb friction", "start", 13, GREY))
    for share, upto, words, y in ((start, start + stick, "sticks", 548), (start + stick, start + contact, "slips", 548)):
        body.append(line([(x(share) + 1, 534), (x(upto) - 1, 534)], INK, 3 if words == "sticks" else 1.5))
        body.append(text((x(share) + x(upto)) / 2, y + 2, words, size=13))
    return page(730, 570, body, "One period: plate and skin, normal force, lateral force")


def main():
    wrong = []
    for name, drawn in (("rig.svg", rig()), ("cycle.svg", vibration())):
        path = PICTURES / name
        if "--check" in sys.argv:
            wrong += [name] * (not path.exists() or path.read_text(encoding="utf-8") != drawn)
        else:
            path.write_text(drawn, encoding="utf-8")
    if wrong:
        sys.exit(f"docs/pictures: {', '.join(wrong)} not as book/pictures.py draws: run it")


if __name__ == "__main__":
    main()
