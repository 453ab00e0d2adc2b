"""What mdBook does not do by itself, as a preprocessor of it.

Equations: a block ```math and a piece $`...`$ (the forms that code hosts draw as well) become MathML, which browsers draw without a script
or a network; \\tag{n} gives the number and the anchor #eq-n. Links to files of the repository beside the book become words: the
book stands alone. Blocks: what a fence says to the tests after its language is taken off.
"""
import json
import re
import sys

from latex2mathml.converter import convert

BLOCK = re.compile(r"^```math\n(.*?)\n```$", re.M | re.S)
INLINE = re.compile(r"\$`([^`]+)`\$")
TAG = re.compile(r"\\tag\{(\w+)\}")
OUTSIDE = re.compile(r"\[([^\]]*)\]\((?:\.\./)+((?!docs/)[^)#]+)(?:#[^)]*)?\)")
CONSOLE = re.compile(r"^( *)```console$", re.M)
FENCE = re.compile(r"^( *)```(\w+) [^\n`]*$", re.M)


PRIME = re.compile(r"<msup>(<mi>[^<]*</mi>)<mi>&#x02032;</mi></msup>")


def drawn(latex, display="inline"):
    """MathML. Upright letters as text: one alone would come out slanted. A prime is a sign of its own and no exponent."""
    return PRIME.sub(r'<mrow>\1<mo lspace="0" rspace="0">&#x02032;</mo></mrow>', convert(latex.replace("\\mathrm{", "\\text{"), display=display))


def block(found):
    latex = found[1]
    tag = TAG.search(latex)
    number = tag[1] if tag else ""
    mathml = drawn(TAG.sub("", latex).replace("\n", " ").strip(), "block")
    name = f' id="eq-{number}"' if number else ""
    return f'<div class="equation"{name}>{mathml}<span class="number">{f"({number})" if number else ""}</span></div>\n'


def outside(depth):
    """A link that leaves docs/: more steps up than the page stands deep."""
    def word(found):
        steps = found[0].split("](")[1].count("../")
        if steps <= depth:
            return found[0]
        text, path = found[1], found[2]
        return text if text.strip("`").endswith(path.split("/")[-1]) else f"{text} (`{path}` in the repository)"
    return word


def chapter(item):
    if not isinstance(item, dict) or "Chapter" not in item:
        return
    page = item["Chapter"]
    text = page["content"]
    text = BLOCK.sub(block, text)
    text = INLINE.sub(lambda found: drawn(found[1]), text)
    if page["path"]:
        text = OUTSIDE.sub(outside(page["path"].count("/")), text)
    page["content"] = CONSOLE.sub(r"\1```text,console", FENCE.sub(r"\1```\2", text))
    for below in page["sub_items"]:
        chapter(below)


if sys.argv[1:2] == ["supports"]:
    sys.exit(0 if sys.argv[2] == "html" else 1)
_, book = json.load(sys.stdin)
for item in book.get("items", book.get("sections", [])):
    chapter(item)
json.dump(book, sys.stdout)
