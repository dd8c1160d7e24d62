"""``hexacell report --output FILE.xml``: the Digital Calibration Certificate of a run.

The order of children is that of PTB's schema 3.3.0, which is not in this repository.
"""

import json
from xml.etree import ElementTree as ET

import pytest

NAMES = {"dcc": "https://ptb.de/dcc", "si": "https://ptb.de/si"}

STATED = """[report]
machine = "Hexaglide of the demo"
serial_number = "HX-7 <&>"
laboratory = "Metrology & Sons, Hall 7"
country = "DE"
customer = "Somebody, Somewhere"
place = "Hall 3"
authorised_by = "The head of the laboratory"
"""

SEQUENCES = {
    "digitalCalibrationCertificate": "administrativeData measurementResults",
    "coreData": "countryCodeISO3166_1 usedLangCodeISO639_1 mandatoryLangCodeISO639_1 uniqueIdentifier "
    "beginPerformanceDate endPerformanceDate performanceLocation issueDate",
    "item": "name description identifications",
    "identification": "issuer value name",
    "software": "name release",
    "respPerson": "person mainSigner",
    "statement": "name description norm declaration conformity",
    "measurementResult": "name usedMethods usedSoftware measuringEquipments influenceConditions results",
    "usedMethod": "name description norm norm",
    "measuringEquipment": "name description identifications measuringEquipmentQuantities",
    "influenceCondition": "name data",
    "result": "name data",
    "quantity": "name real",
    "real": "value unit measurementUncertaintyUnivariate",
    "expandedMU": "valueExpandedMU coverageFactor coverageProbability",
    "contact": "name location",
    "customer": "name location",
}
"""The children of each, in this order; some may be absent."""


@pytest.fixture
def certified(run):
    """A copy of the demo's run, whose cell file says who calibrates what for whom."""
    cell = run / "cell.toml"
    text = cell.read_text()
    assert "[report]" not in text
    certificate = 'certificate = { number = "D-K-1 2026/7", due = "2027-03-31", expanded_um = 1.5 }'
    cell.write_text(f"{text}\n{STATED}".replace("[[gauges]]", f"[[gauges]]\n{certificate}", 1))
    return run


@pytest.fixture
def certificate(typed_here, certified, tmp_path):
    target = tmp_path / "certificate.xml"
    outcome = typed_here("report", certified, "--output", target)
    assert outcome.code == 0, outcome.err
    assert outcome.out == f"{target}: Digital Calibration Certificate, PASS\n"
    return target


def local(element) -> str:
    return str(element.tag).rpartition("}")[2]


def quantities(root) -> dict[str, tuple[str, str, str | None]]:
    """Value, unit and U by name."""
    found = {}
    for one in root.iterfind(".//dcc:results//dcc:quantity", NAMES):
        name = one.findtext("dcc:name/dcc:content", namespaces=NAMES)
        texts = (one.findtext(f".//si:{tag}", namespaces=NAMES) for tag in ("value", "unit"))
        found[name] = (*texts, one.findtext(".//si:valueExpandedMU", namespaces=NAMES))
    return found


def test_it_has_the_results_of_the_run(certificate, demo, run) -> None:
    root = ET.parse(certificate).getroot()
    found = quantities(root)
    accuracy = demo.outcome.document["verification"]["accuracy"]
    for name, unit in (("position", r"\milli\metre"), ("orientation", r"\degree")):
        value, shown, expanded = found[f"{name} error"]
        assert shown == unit
        assert (float(value), float(str(expanded))) == pytest.approx(
            (accuracy[name]["value"], accuracy[name]["expanded"]), abs=1e-6
        )
        assert float(found[f"limit of the {name} error"][0]) == accuracy[name]["limit"]
    assert {one.text for one in root.iterfind(".//si:coverageFactor", NAMES)} == {"2.0"}
    for parameter in json.loads((run / "result.json").read_text())["parameters"]:
        if parameter["sigma"]:
            value, _, expanded = found[parameter["name"]]
            assert float(value) == pytest.approx(parameter["value"], abs=1e-6)
            assert float(str(expanded)) == pytest.approx(2 * parameter["sigma"], abs=1e-6)


def test_it_says_of_what_by_what_and_by_which_rule(certificate, run, typed_here) -> None:
    root = ET.parse(certificate).getroot()
    core = {local(one): one.text for one in root.find(".//dcc:coreData", NAMES) or ()}
    identifier = typed_here("report", run, "--json").document["identifier"]
    assert (core["uniqueIdentifier"], core["countryCodeISO3166_1"]) == (identifier, "DE")
    item = root.find(".//dcc:item", NAMES)
    assert item is not None
    assert item.findtext(".//dcc:value", namespaces=NAMES) == "HX-7 <&>"
    statement = root.find(".//dcc:statement", NAMES)
    assert statement is not None
    assert statement.findtext("dcc:conformity", namespaces=NAMES) == "pass"
    rule = statement.findtext("dcc:description/dcc:content", namespaces=NAMES)
    assert rule is not None
    assert rule.startswith("Decision rule: pass if")
    assert "in one round of visits to all task poses, and U" in rule
    assert "ISO 9283" in rule
    equipment = list(root.iterfind(".//dcc:measuringEquipment", NAMES))
    texts = {
        one.findtext("dcc:name/dcc:content", namespaces=NAMES): list(one.itertext()) for one in equipment
    }
    certified = [texts_of for texts_of in texts.values() if "D-K-1 2026/7" in texts_of]
    assert len(certified) == 1
    assert any("2027-03-31" in text for text in certified[0])
    assert root.find(".//dcc:influenceCondition", NAMES) is not None


def test_children_stand_in_the_order_of_the_schema_and_no_text_is_empty(certificate) -> None:
    root = ET.parse(certificate).getroot()
    checked = set()
    for element in root.iter():
        order = SEQUENCES.get(local(element), "").split()
        if order:
            checked.add(local(element))
            for child in element:
                assert local(child) in order, (local(element), local(child))
                del order[: order.index(local(child)) + 1]
    assert checked == set(SEQUENCES)
    assert root.get("schemaVersion") == "3.3.0"
    root = ET.parse(certificate).getroot()
    for element in root.iter():
        if len(element) == 0:
            assert element.text, local(element)
            assert element.text == " ".join(element.text.split())
        assert element.get("lang", "en") == "en"
    assert all(one.get("lang") for one in root.iterfind(".//dcc:content", NAMES))


def test_what_cannot_be_certified_is_not(typed_here, demo, certified, tmp_path) -> None:
    def refused(run, *more) -> str:
        outcome = typed_here("report", run, "--output", tmp_path / "x.xml", *more)
        assert (outcome.code, (tmp_path / "x.xml").exists()) == (2, False)
        return str(outcome.err)

    assert "needs serial_number, laboratory, country, customer, authorised_by" in refused(demo.run)
    assert "a certificate compares nothing" in refused(certified, "--compare", demo.run)
    journal = certified / "journal.jsonl"
    kept = [line for line in journal.read_bytes().splitlines(keepends=True) if b'"judged"' not in line]
    journal.write_bytes(b"".join(kept[: len(kept) // 2]))
    assert "nothing can be certified" in refused(certified)
