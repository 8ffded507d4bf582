"""Users' texts are printed as they are: no markup, no emoji codes, whatever they hold and however long they are."""

import pytest
from typer.testing import CliRunner

from exumob.__main__ import app
from exumob.commands.shared import console, errors

TEXTS = ["[/red]", "[bold]old[/bold]", "run[old]:smile:", "%s {0}", "a:b", "[link a]b", "x" * 3000, "a\nb"]
COMMANDS = {
    "lane-change, soil": ["lane-change", "--soil", "{}"],
    "lane-change, vehicle": ["lane-change", "--vehicle", "{}.py"],
    "lane-change, output": ["lane-change", "--output", "none/{}.nc"],
    "lane-change, networks": ["lane-change", "--networks", "{}.safetensors"],
    "captive": ["captive", "--vehicle", "{}.py"],
    "sweep, study": ["sweep", "{}.toml", "--output", "out"],
    "sweep, set": ["sweep", "--set", "{}", "--output", "out"],
    "map": ["map", "--current", "{}", "--output", "out"],
    "export": ["export", "{}.safetensors", "--output", "a.onnx"],
    "verify": ["verify", "{}"],
}


@pytest.mark.parametrize("text", TEXTS[::2], ids=lambda text: text[:12])
@pytest.mark.parametrize("command", COMMANDS)
def test_texts_come_back_as_they_were_given(command, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    answer = CliRunner().invoke(app, [part.replace("{}", text) for part in COMMANDS[command]])
    assert answer.exit_code == 2 and isinstance(answer.exception, SystemExit), answer.output
    said = answer.output.replace("\n", "").replace(" ", "")
    shown = text.replace(" ", "")[:20]
    assert shown.replace("\n", "") in said or shown.replace("\n", "\\n") in said, answer.output
    assert "Traceback" not in answer.output
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("text", TEXTS, ids=lambda text: text[:12])
@pytest.mark.parametrize("out", [console, errors], ids=["console", "errors"])
def test_consoles_change_nothing(out, text):
    with out.capture() as caught:
        out.print(text, style="red", soft_wrap=True)
    assert text in caught.get()
