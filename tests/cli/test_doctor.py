"""`evonav doctor`: what it finds, what it tells, and with which exit code."""

import json
import re
import sys
from contextlib import nullcontext
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from threading import Thread

import pytest
from typer.testing import CliRunner

from evonav.cli import app
from evonav.cli.doctor import EXTRAS, all_checks

ROOT = Path(__file__).parents[2]
module = sys.modules["evonav.cli.doctor"]  # `evonav.cli.doctor` is also the name of its command


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(module, "RENDER_S", 0.02)
    for name in ("OPENAI_API_KEY", "OPENAI_BASE_URL"):
        monkeypatch.delenv(name, raising=False)


def found(tmp_path, **where):
    return {check.name: check for check in all_checks(tmp_path, **where)}


def test_a_machine_on_which_evonav_works(tmp_path):
    checks = found(tmp_path / "not" / "there")
    assert [name for name, check in checks.items() if check.is_essential] == [
        "evonav",
        "python",
        "bundled tasks",
        "renderer",
    ]
    assert all(check.state == "ok" for check in checks.values() if check.is_essential)
    assert re.search(r"[1-9]\d* views/s of 300x300", checks["renderer"].finding)
    assert checks["bundled tasks"].finding.startswith("24,")
    assert str(tmp_path) in checks["run folder"].finding
    assert "locks work" in checks["run folder"].finding
    assert list(tmp_path.iterdir()) == []
    assert all(check.remedy for check in checks.values() if check.state == "failed")


def test_the_command_prints_a_line_a_check_and_json(tmp_path):
    done = CliRunner().invoke(app, ["doctor", "--out", str(tmp_path), "--no-network"])
    assert done.exit_code == 0
    *lines, last = done.stdout.splitlines()
    assert last.startswith("evonav is ready: all that the benchmark needs works.")
    assert not any(line.startswith("missing") for line in lines)
    every = CliRunner().invoke(app, ["doctor", "--out", str(tmp_path), "--no-network", "--all"])
    names = list(found(tmp_path))
    assert len(every.stdout.splitlines()) == len(names) + 1
    as_json = CliRunner().invoke(app, ["doctor", "--json", "--no-network"])
    content = json.loads(as_json.stdout)
    assert content["is_ok"]
    assert [check["name"] for check in content["checks"]] == names


def test_the_exit_code_is_of_what_is_essential(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_gpu", lambda: 1 / 0)
    assert CliRunner().invoke(app, ["doctor", "--no-network"]).exit_code == 0
    monkeypatch.setattr(module, "_renderer", lambda: 1 / 0)
    done = CliRunner().invoke(app, ["doctor", "--no-network"])
    assert done.exit_code == 1
    assert "ZeroDivisionError" in done.stdout
    assert "evonav is not ready" in done.stdout
    assert found(tmp_path)["renderer"].is_essential


def test_every_extra_is_looked_for():
    """As `pyproject.toml` has them."""
    text = (ROOT / "pyproject.toml").read_text()
    section = text.split("[project.optional-dependencies]")[1].split("\n[")[0]
    assert list(EXTRAS) == re.findall(r"^(\w+) = \[", section, re.MULTILINE)


def test_a_missing_extra_says_how_to_get_it(monkeypatch, tmp_path):
    needed = ["numpy>=2", "matplotlib>=3.8; extra == 'viz'", "no-such-package ; extra == 'viz'"]
    monkeypatch.setattr(module, "requires", lambda _: needed)
    check = found(tmp_path)["extra viz"]
    assert (check.state, check.remedy) == ("missing", "pip install 'evonav[viz]'")
    assert check.finding.endswith("(no no-such-package)")


def test_files_of_models_are_looked_for_where_they_are_to_be(monkeypatch, tmp_path):
    monkeypatch.setenv("EVONAV_MODELS", str(tmp_path))
    check = found(tmp_path)["models 3d-mem"]
    assert check.state == "missing"
    assert f"4 of 4 files are not in {tmp_path} (about 2607 MB): yolov8x-world.pt" in check.finding
    for name in ("timm/vit_base_patch32_clip_224.openai", "laion/CLIP-ViT-B-32-laion2B-s34B-b79K"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "open_clip_model.safetensors").touch()
    for name in ("yolov8x-world.pt", "sam_l.pt"):
        (tmp_path / name).touch()
    checks = found(tmp_path)
    assert (checks["models 3d-mem"].state, checks["models unigoal"].state) == ("ok", "missing")


def test_a_folder_that_cannot_be_written_or_locked(monkeypatch, tmp_path):
    monkeypatch.setattr("evonav.parallel.folders.writing", nullcontext)
    assert found(tmp_path)["run folder"].state == "failed"
    assert "local disk" in found(tmp_path)["run folder"].remedy

    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(module.tempfile, "TemporaryDirectory", refuse)
    assert "Permission denied" in found(tmp_path)["run folder"].finding


@pytest.mark.parametrize(("status", "state", "words"), [(200, "ok", "answers"), (401, "failed", "OPENAI_API_KEY")])
def test_an_endpoint_is_asked_only_where_it_may_be(monkeypatch, tmp_path, status, state, words):
    asked = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            asked.append((self.path, self.headers["Authorization"]))
            self.send_response(status)
            self.send_header("Content-Length", "2")
            self.end_headers()
            self.wfile.write(b"{}")

        def log_message(self, *_):
            pass

    monkeypatch.setenv("OPENAI_API_KEY", "sk-canary")
    server = HTTPServer(("127.0.0.1", 0), Handler)
    Thread(target=server.serve_forever, daemon=True).start()
    try:
        url = f"http://127.0.0.1:{server.server_port}/v1"
        assert found(tmp_path, base_url=url, uses_network=False)["model endpoint"].state == "ok"
        assert asked == []
        check = found(tmp_path, base_url=url)["model endpoint"]
    finally:
        server.shutdown()
        server.server_close()
    assert asked == [("/v1/models", "Bearer sk-canary")]
    assert check.state == state
    assert words in check.finding + check.remedy
    assert "canary" not in check.finding + check.remedy
    lost = found(tmp_path, base_url=url)["model endpoint"]
    assert lost.state == "failed"
