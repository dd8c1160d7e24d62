"""Pictures of the screen one after the other in one SVG: by CSS alone, as pages allow no scripts in it."""

import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import accumulate

STYLE = re.compile(r"\.terminal-(r\d+) \{ (.*?) \}")
ELEMENT = re.compile(r'<rect [^>]*crispEdges"/>|<text class="terminal-r\d+"[^>]*>[^<\n]+</text>')
NEEDLESS = re.compile(r' (?:clip-path|shape-rendering)="[^"]*"')
CLASS = re.compile(r'class="terminal-(r\d+)"')
WINDOW = re.compile(r'(?<=</defs>)\s*(.*?)\s*<g transform="translate\(9', re.DOTALL)
TITLE = re.compile(r"\.terminal-title \{.*?\}", re.DOTALL)


def animated(pictures: Sequence[str], seconds: Sequence[float]) -> str:
    """The pictures, each for so long, again and again; the last one alone where motion is not wanted.

    What several in a row have is drawn once, in a group that is visible from the first to the last of them.
    """
    classes: dict[str, str] = {}
    shown = [dict.fromkeys(_elements(picture, classes)) for picture in pictures]
    groups: defaultdict[tuple[str, int, int], list[str]] = defaultdict(list)
    end = len(shown) - 1
    for first, elements in enumerate(shown):
        for element in elements:
            if first == 0 or element not in shown[first - 1]:
                last = next((n for n in range(first, end) if element not in shown[n + 1]), end)
                groups[element[1:5], first, last].append(element)
    spans = sorted({(first, last) for _, first, last in groups})
    begins = [0.0, *accumulate(seconds)]
    window, title = WINDOW.search(pictures[-1]), TITLE.search(pictures[-1])
    assert window is not None
    assert title is not None
    lines = [
        pictures[-1].partition("\n")[0],
        f"<style>\n{title[0]}\ntext {{ font-family: Fira Code, monospace; font-size: 20px }}",
        *(f".{name} {{ {style} }}" for style, name in classes.items()),
        *(f".s{first}-{last} {{ visibility: hidden }}" for first, last in spans if last < end),
        "@media (prefers-reduced-motion: no-preference) {",
        *(_visibility(first, last, begins) for first, last in spans),
        f'}}\n</style>\n{window[1]}\n<g transform="translate(9, 41)" shape-rendering="crispEdges">',
        *(f'<g class="s{n}-{m}">{"".join(groups[kind, n, m])}</g>' for kind, n, m in sorted(groups)),
        "</g>\n</svg>\n",
    ]
    return "\n".join(lines)


def _elements(picture: str, classes: dict[str, str]) -> Iterator[str]:
    """What a picture draws, with class names for styles that all pictures share."""
    styles = dict(STYLE.findall(picture))

    def own(name: re.Match[str]) -> str:
        return f'class="{classes.setdefault(styles[name[1]], f"c{len(classes)}")}"'

    for element in ELEMENT.findall(picture):
        yield CLASS.sub(own, NEEDLESS.sub("", element)).replace("&#160;", "\N{NO-BREAK SPACE}")


def _visibility(first: int, last: int, begins: Sequence[float]) -> str:
    """The animation of a group that is visible from one picture to another."""
    name, end = f"s{first}-{last}", begins[-1]
    times = {0.0: "hidden"} | {begins[first]: "visible", begins[last + 1]: "hidden"}
    frames = " ".join(f"{100 * at / end:.2f}% {{ visibility: {how} }}" for at, how in times.items())
    return f"@keyframes {name} {{ {frames} }} .{name} {{ animation: {name} {end:g}s step-end infinite }}"
