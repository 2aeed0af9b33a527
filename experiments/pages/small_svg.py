"""Pictures that matplotlib drew, as SVG of about half the size that look the same.

Coordinates are rounded to a tenth of a point of paper, styles that recur are written once, and ids that nothing refers
to, empty groups, and metadata go.
"""

import re
from xml.etree import ElementTree

SVG, LINK = "{http://www.w3.org/2000/svg}", "{http://www.w3.org/1999/xlink}href"
_WORDS = {f"{SVG}{name}" for name in ("text", "style", "title")}  # elements whose text counts
_PLACES = ("d", "x", "y", "transform")  # attributes that hold coordinates
_LONG = re.compile(r"-?\d+\.\d+")
_COMMAND = re.compile(r"\s*([A-Za-z])\s*")
_REFERENCE = re.compile(r"#([\w.-]+)")

ElementTree.register_namespace("", SVG[1:-1])
ElementTree.register_namespace("xlink", LINK[1:-5])


def smaller(svg: str) -> str:
    """The picture with less text.

    Raises
    ------
    xml.etree.ElementTree.ParseError
        For text that is no SVG.
    """
    root = ElementTree.fromstring(svg)
    used = {name for each in root.iter() for text in each.attrib.values() for name in _REFERENCE.findall(text)}
    styles: dict[str, str] = {}
    for each in root.iter():
        if each.get("id") not in used:
            each.attrib.pop("id", None)
        for name in _PLACES:
            if name in each.attrib:
                each.set(name, _LONG.sub(_tenth, each.attrib[name]))
        if "d" in each.attrib:
            each.set("d", " ".join(_COMMAND.sub(r"\1", each.attrib["d"]).split()))
        if each.get("transform", "").startswith("rotate(-0 "):
            del each.attrib["transform"]
        if "style" in each.attrib:
            each.set("class", styles.setdefault(each.attrib.pop("style"), f"s{len(styles)}"))
        if each.tag not in _WORDS:
            each.text = None
        each.tail = None
    _flatten(root)
    sheet = ElementTree.Element(f"{SVG}style")
    sheet.text = "".join(f".{name}{{{style}}}" for style, name in styles.items())
    root.insert(0, sheet)
    return ElementTree.tostring(root, encoding="unicode")


def _tenth(found: re.Match[str]) -> str:
    return f"{float(found[0]):.1f}".removesuffix(".0")


def _flatten(parent: ElementTree.Element) -> None:
    """Put what is in groups without attributes in their place, and leave out metadata."""
    children = []
    for child in list(parent):
        if child.tag == f"{SVG}metadata":
            continue
        _flatten(child)
        children += list(child) if child.tag == f"{SVG}g" and not child.attrib else [child]
    parent[:] = children
