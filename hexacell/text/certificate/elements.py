"""Elements of a Digital Calibration Certificate: texts, quantities in D-SI, contacts.

Sources: the schemas https://ptb.de/dcc/v3.3.0/dcc.xsd and https://ptb.de/si/v2.2.1/SI_Format.xsd.
"""

from __future__ import annotations

import re
from xml.etree.ElementTree import Element, SubElement, register_namespace

from hexacell.uncertainty.statement import COVERAGE, COVERAGE_FACTOR

DCC, SI = "https://ptb.de/dcc", "https://ptb.de/si"
LANGUAGE = "en"
UNITS = {"mm": r"\milli\metre", "um": r"\micro\metre", "deg": r"\degree", "rad": r"\radian", "": r"\one"}
"""Of the program, as D-SI writes them."""

DEGREE_CELSIUS = r"\degreecelsius"
DECIMALS = 6

# XML 1.0 has no others, and none of the escapes that it has makes one valid.
_NOT_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

register_namespace("dcc", DCC)
register_namespace("si", SI)


def add(parent: Element, name: str, text: str | None = None) -> Element:
    """A new child; its text in one line, as most types of the schema want it."""
    made = SubElement(parent, f"{{{DCC}}}{name}")
    if text is not None:
        made.text = " ".join(_NOT_IN_XML.sub("?", text).split())
    return made


def add_text(parent: Element, name: str, text: str) -> Element:
    """A child that holds text for people."""
    made = add(parent, name)
    add(made, "content", text).set("lang", LANGUAGE)
    return made


def add_identification(parent: Element, issuer: str, value: str, name: str) -> None:
    """A number of an item or instrument, by whom it was given, and what it is."""
    made = add(parent, "identification")
    add(made, "issuer", issuer)
    add(made, "value", value)
    add_text(made, "name", name)


def add_contact(parent: Element, name: str, text: str, country: str | None = None) -> None:
    """A name with its address, which is one text in the cell file."""
    made = add(parent, name)
    add_text(made, "name", text)
    location = add(made, "location")
    if country is not None:
        add(location, "countryCode", country)
    add_text(location, "further", text)


def add_quantity(
    parent: Element,
    name: str,
    value: float,
    unit: str,
    expanded: float | None = None,
    tag: str = "quantity",
) -> None:
    """A value with its unit in D-SI and, if there is one, its expanded uncertainty."""
    made = add(parent, tag)
    add_text(made, "name", name)
    real = SubElement(made, f"{{{SI}}}real")
    _add_si(real, "value", f"{value:.{DECIMALS}f}")
    _add_si(real, "unit", unit)
    if expanded is None:
        return
    uncertainty = _add_si(_add_si(real, "measurementUncertaintyUnivariate"), "expandedMU")
    _add_si(uncertainty, "valueExpandedMU", f"{expanded:.{DECIMALS}f}")
    _add_si(uncertainty, "coverageFactor", f"{COVERAGE_FACTOR:.1f}")
    _add_si(uncertainty, "coverageProbability", f"{COVERAGE:g}")


def _add_si(parent: Element, name: str, text: str | None = None) -> Element:
    made = SubElement(parent, f"{{{SI}}}{name}")
    made.text = text
    return made
