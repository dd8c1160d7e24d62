"""`devices --write --answers`: every mechanism and controller, of plug-ins too, to a valid cell file."""

import shutil
import sys
from pathlib import Path

import pytest

from drivers.discovery import FoundController
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.plugins import Group, names
from hexacell.services.devices.device_search import SearchFindings
from hexacell.services.devices.first_cell import CELLS, CellDraft
from hexacell.storage.toml_document import TomlDocument
from hexacell.text.screens.answers_file import take, template
from hexacell.text.screens.first_questions import FirstCellAssistant

RING = Path(__file__).parents[1] / "packages" / "ring_mechanism"
CONFIGS = {name: bundled_config(name).with_name(f"{name}.controller.toml") for name in CELLS}
CONFIGS["ring"] = RING / "cells" / "ring.controller.toml"
OF_RING = {"joints": "-700 700", "points": "0 0 400 60"}
"""What no cell that comes along proposes."""
OPTIONS = {
    "adapter": ['options.command = ["python3", "my-adapter.py"]'],
    "opcua": ['options.endpoint = "opc.tcp://10.0.0.5:4840"', 'options.node = "ns=3;s=robot.{name}"'],
    "talker": ['options.address = "room 5"', "options.rate = 7", 'options.nodes = { done = "n1" }'],
    "chooser": ['options.there = "room 6"'],
}
PLUGIN = """
from pydantic import model_validator
from hexacell.cell.fields import Password, Text, broken_rule, key
from hexacell.cell.robot import ControllerOptions

class Talker:
    class Options(ControllerOptions):
        address: Text = key(..., "where it listens")
        rate: int = key(5, "how often it is asked", ge=1, le=9)
        nodes: dict[str, Text] = key({}, "its nodes by name")
        password: Password | None = key(None, "what it wants to hear")

class Chooser:
    class Options(ControllerOptions):
        here: Text | None = key(None, "a program")
        there: Text | None = key(None, "an address")

        @model_validator(mode="after")
        def _one(self):
            if (self.here is None) == (self.there is None):
                raise broken_rule("here or there is needed", "Write one of them")
            return self
"""


@pytest.fixture(autouse=True)
def plugins(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package with a mechanism and two controllers that have options, and nothing connected."""
    folder = tmp_path_factory.mktemp("installed")
    shutil.copy(RING / "hexacell_ring.py", folder)
    (folder / "hexacell_talker.py").write_text(PLUGIN)
    info = folder / "hexacell_talker-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: hexacell-talker\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        f"[{Group.MECHANISMS.entry_points}]\nring = hexacell_ring:Ring\n"
        f"[{Group.CONTROLLERS.entry_points}]\ntalker = hexacell_talker:Talker\n"
        "chooser = hexacell_talker:Chooser\nbroken = no_such_module:Driver\n"
    )
    monkeypatch.syspath_prepend(folder)
    for module in ("hexacell_ring", "hexacell_talker"):
        monkeypatch.delitem(sys.modules, module, raising=False)

    async def search(*_: object) -> SearchFindings:
        return SearchFindings((), (), (), FoundController("10.0.0.7", 5008, "HELLO ACK"))

    monkeypatch.setattr("hexacell.cli.commands.devices.search_devices", search)
    monkeypatch.setattr("hexacell.cli.commands.devices.is_interactive", lambda: False)


def answered(draft: CellDraft, **changed: str) -> str:
    """The template with these answers, of which the options of a controller are those above."""
    of_template = dict(TomlDocument.parse(template(draft)).data)
    told = {"gauges": of_template.pop("gauges")}
    lines = [
        f"{name} = {given!r}" for name, given in {**of_template, **changed}.items() if name != "options"
    ]
    for axis, gauge in told["gauges"].items():
        lines += [f"gauges.{axis}.{key} = {given!r}" for key, given in gauge.items()]
    return "\n".join([*lines, *OPTIONS.get(changed.get("controller", ""), ())])


@pytest.mark.parametrize("mechanism", CONFIGS)
@pytest.mark.parametrize("controller", ["linuxcncrsh", "adapter", "opcua", "linuxcnc", "talker", "chooser"])
def test_every_mechanism_and_controller_ends_in_a_valid_file(tmp_path, mechanism, controller) -> None:
    if controller not in names(Group.CONTROLLERS):
        pytest.skip("it is not built in")
    shutil.copy(CONFIGS[mechanism], tmp_path)
    draft = CellDraft(tmp_path / "new.toml")
    changed = OF_RING if mechanism == "ring" else {}
    take(draft, TomlDocument.parse(answered(draft, controller=controller, **changed)))
    draft.write()
    settings = load_cell(draft.path).settings
    assert settings.robot.mechanism == draft.mechanism.name
    assert settings.controller.protocol == controller
    if controller == "talker":
        options = settings.controller.options.model_dump()
        assert (options["address"], options["rate"], options["nodes"]) == ("room 5", 7, {"done": "n1"})


def test_the_screen_asks_for_what_the_options_of_a_plugin_need(tmp_path: Path) -> None:
    shutil.copy(CONFIGS["ring"], tmp_path)
    assistant = FirstCellAssistant(tmp_path / "new.toml")
    typed = {"where it listens": "room 5", "carriages go": OF_RING["joints"]}
    typed |= {"middle of the workspace": OF_RING["points"], "How is the controller": "talker"}
    while not assistant.is_done:
        asked, _ = assistant.question
        assert "network name" not in asked
        [given] = [one for words, one in typed.items() if words in asked][-1:] or [assistant.suggestion]
        if words := [one for one in ("where it listens", "carriages go") if one in asked]:
            assistant.answer("")
            assert assistant.problem == "Please type an answer.", words
        assistant.answer(given)
        assert assistant.problem == ""
    assert load_cell(tmp_path / "new.toml").settings.controller.options.model_dump()["address"] == "room 5"


def test_a_new_file_gets_every_question_and_what_was_found(typed_here, tmp_path) -> None:
    shutil.copy(CONFIGS["gough-stewart"], tmp_path)
    command = ("devices", "--write", "new.toml", "--answers", "answers.toml")
    asked = typed_here(*command)
    assert asked.code == 4
    assert "answers.toml is new" in asked.err
    text = (tmp_path / "answers.toml").read_text()
    for words in ('host = "10.0.0.7"', '# options.address = ""', "where it listens", "gauges.z.sign"):
        assert words in text
    assert typed_here(*command).code == 0
    controller = load_cell(tmp_path / "new.toml").settings.controller
    assert (controller.protocol, controller.host, controller.port) == ("linuxcncrsh", "10.0.0.7", 5008)
    assert typed_here("cell", "validate", "new.toml").code == 0


def test_all_that_is_wrong_is_named_at_once_and_nothing_is_written(typed_here, tmp_path) -> None:
    shutil.copy(CONFIGS["simulated-hexaglide"], tmp_path)
    (tmp_path / "answers.toml").write_text(
        'name = 5\nconfig = "nowhere.toml"\ntolerance = -1\ncontroller = "talker"\njoints = [1]\n'
        "nodes = [1, 2, 3, 4, 5, 6.5]\nplates = true\npoints = [0, 0, 5500, 200]\ncolour = 1\n"
        '[gauges.x]\nprotocol = "sylvak"\nsign = "maybe"\n'
        '[options]\nrate = 20\npasswort = "geheim"\npassword = 77123\n'
    )
    refused = typed_here("devices", "--write", "new.toml", "--answers", "answers.toml")
    assert refused.code == 2
    told = " ".join(refused.err.split())
    for words in (
        "answers.toml:2: config: ",
        "answers.toml:3: tolerance: 'S_mm' in [tolerances] is -1.0, but must be more than 0",
        "answers.toml: options.address is missing",
        "answers.toml:14: options.rate: 'rate' in [controller.options] is 20, but must be 9 or less",
        "answers.toml:16: options.password: 'password' in [controller.options] must be text",
        "answers.toml:5: joints: 2 numbers are expected",
        "answers.toml:11: gauges.x.protocol: it is one of cdi,",
        "answers.toml:12: gauges.x.sign: answer yes or no",
        "answers.toml: gauges.y.port is missing",
        "answers.toml:6: nodes: '6.5' is no whole number",
        "answers.toml:7: plates: 'yes' is no number",
        "there is no question options.passwort. Did you mean 'options.password'?",
        "answers.toml:9: there is no question colour. There are: bus,",
    ):
        assert words in told, words
    assert "geheim" not in told
    assert "77123" not in told
    assert not (tmp_path / "new.toml").exists()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("name =", "answers.toml:1: not valid TOML"),
        ('controller = "talkr"\noptions.address = "a"', "controller: it is one of"),
        ('controller = "broken"', "controller protocol 'broken' cannot be loaded"),
    ],
)
def test_what_is_no_file_of_answers_is_refused(typed_here, tmp_path, text, told) -> None:
    (tmp_path / "answers.toml").write_text(text)
    refused = typed_here("devices", "--write", "new.toml", "--answers", "answers.toml")
    assert (refused.code, told in " ".join(refused.err.split())) == (2, True), refused.err
    assert [one.name for one in tmp_path.iterdir()] == ["answers.toml"]


def test_answers_that_fit_each_other_badly_leave_no_file(typed_here, tmp_path) -> None:
    shutil.copy(CONFIGS["linapod"], tmp_path)
    draft = CellDraft(tmp_path / "new.toml")
    (tmp_path / "answers.toml").write_text(answered(draft, points="0 0 5500 200"))
    refused = typed_here("devices", "--write", "new.toml", "--answers", "answers.toml")
    assert (refused.code, "out of reach" in refused.err) == (2, True)
    assert not draft.path.exists()


def test_without_a_terminal_the_option_is_named(typed_here) -> None:
    refused = typed_here("devices", "--write", "new.toml")
    assert (refused.code, "--answers" in refused.err) == (4, True)
    assert typed_here("devices", "--answers", "answers.toml").code == 2
