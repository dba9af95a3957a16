"""The files around the package: workflows, forms, hooks, metadata and versions agree with what they name."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from build_docs import links

from evonav.toml import tomllib

ROOT = Path(__file__).parents[2]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
FORMS = sorted(path for path in (ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml") if path.name != "config.yml")
YAML = [*ROOT.glob(".github/**/*.yml"), ROOT / ".pre-commit-config.yaml"]
SYSTEMS = {"ubuntu": "POSIX :: Linux", "macos": "MacOS", "windows": "Microsoft :: Windows"}
ARXIV = "2609.08292"
REPOSITORY_PATH = re.compile(r"(?<![\w./-])(?:\.ci|benches|docs|examples|scripts|tests)/[\w./-]*\w")


class _UniqueKeys(yaml.SafeLoader):
    """A YAML reader that rejects a key given twice."""

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        keys = [key.value for key, _ in node.value]
        assert len(keys) == len(set(keys)), f"a key is given twice: {keys}"
        return super().construct_mapping(node, deep=deep)


def read(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def load_yaml(path: Path) -> dict[Any, Any]:
    content = yaml.load(read(path), _UniqueKeys)
    assert isinstance(content, dict)
    return content


@pytest.fixture(scope="module")
def pyproject() -> dict[str, Any]:
    return tomllib.loads(read(ROOT / "pyproject.toml"))


@pytest.fixture(scope="module")
def cargo() -> dict[str, Any]:
    return tomllib.loads(read(ROOT / "Cargo.toml"))["workspace"]


def make_targets() -> dict[str, str]:
    """Return the Makefile's targets for people, with the text that `make help` prints."""
    return dict(re.findall(r"^([a-z-]+):.*?(?:  ## (.*))?$", read(ROOT / "Makefile"), re.MULTILINE))


@pytest.mark.parametrize("path", YAML, ids=lambda path: path.name)
def test_yaml_is_read_and_has_no_key_twice(path: Path) -> None:
    assert load_yaml(path)


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_a_workflow_names_targets_files_and_jobs_that_exist(path: Path) -> None:
    workflow = load_yaml(path)
    assert workflow["permissions"] == {"contents": "read"}, "a job that needs more asks for it"
    for name, job in workflow["jobs"].items():
        needs = job.get("needs", [])
        assert set([needs] if isinstance(needs, str) else needs) <= set(workflow["jobs"])
        for step in job["steps"]:
            assert ("uses" in step) != ("run" in step), f"{name}: {step}"
            assert re.fullmatch(r"[\w-]+/[\w-]+@[\w/]+", step.get("uses", "a/b@c")), f"{name}: no version in {step}"
            command = step.get("run", "")
            assert set(re.findall(r"(?:^|\s)make ([\w-]+)", command)) <= set(make_targets()), command
            missing = [found for found in REPOSITORY_PATH.findall(command) if not (ROOT / found).exists()]
            assert missing == [], f"{name}: {missing}"
            for group in re.findall(r"--group ([\w-]+)", command):
                assert re.search(rf"^{group} = \[", read(ROOT / "pyproject.toml"), re.MULTILINE), group


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_expressions_of_a_workflow_name_keys_of_its_matrix_and_steps(path: Path) -> None:
    for job in load_yaml(path)["jobs"].values():
        matrix = job.get("strategy", {}).get("matrix", {})
        keys = {*matrix, *(key for row in matrix.get("include", []) for key in row)}
        assert set(re.findall(r"\bmatrix\.(\w+)", str(job))) == keys - {"include"}
        assert set(re.findall(r"\bsteps\.(\w+)", str(job))) <= {step.get("id") for step in job["steps"]}


def test_ci_tests_every_python_and_system_of_the_metadata(pyproject: dict[str, Any], cargo: dict[str, Any]) -> None:
    project = pyproject["project"]
    classifiers = project["classifiers"]
    versions = [name.rpartition(" :: ")[2] for name in classifiers if re.search(r"Python :: 3\.\d+$", name)]
    matrix = load_yaml(ROOT / ".github" / "workflows" / "ci.yml")["jobs"]["wheel"]["strategy"]["matrix"]
    assert matrix["python"] == versions
    assert project["requires-python"] == f">={versions[0]}"
    assert cargo["dependencies"]["pyo3"]["features"] == [f"abi3-py{versions[0].replace('.', '')}"]
    systems = {SYSTEMS[system.partition("-")[0]] for system in matrix["system"]}
    assert systems == {name.partition(" :: ")[2] for name in classifiers if name.startswith("Operating System")}


def test_wheels_are_built_for_the_systems_that_ci_tests() -> None:
    workflows = ROOT / ".github" / "workflows"
    tested = load_yaml(workflows / "ci.yml")["jobs"]["wheel"]["strategy"]["matrix"]["system"]
    built = load_yaml(workflows / "wheels.yml")["jobs"]["wheel"]["strategy"]["matrix"]["include"]
    assert set(tested) <= {row["runner"] for row in built}
    uploads = read(workflows / "wheels.yml").count("name: dist-")
    assert uploads == 2, "the wheels and the source distribution are what `publish` downloads"


@pytest.mark.parametrize("path", FORMS, ids=lambda path: path.name)
def test_an_issue_form_has_what_github_asks_for(path: Path) -> None:
    form = load_yaml(path)
    assert {"name", "description", "body"} <= set(form)
    ids = [field["id"] for field in form["body"]]
    assert len(ids) == len(set(ids))
    assert all(field["attributes"]["label"] for field in form["body"])
    missing = [found for found in REPOSITORY_PATH.findall(read(path)) if not (ROOT / found).exists()]
    assert missing == []


def test_hooks_run_tools_of_the_environment(pyproject: dict[str, Any]) -> None:
    lint = {re.split(r"[>=]", tool)[0] for tool in pyproject["dependency-groups"]["lint"]}
    for hook in load_yaml(ROOT / ".pre-commit-config.yaml")["repos"][0]["hooks"]:
        program, *arguments = hook["entry"].split()
        assert program == "cargo" or program.removeprefix(".venv/bin/") in {"python", *lint}
        assert all((ROOT / argument).exists() for argument in arguments if argument.endswith(".py"))


def test_make_help_lists_every_command() -> None:
    (phony,) = re.findall(r"^\.PHONY: (.*)$", read(ROOT / "Makefile"), re.MULTILINE)
    targets = make_targets()
    assert set(phony.split()) == set(targets)
    assert [target for target, text in targets.items() if not text] == []


def test_changelog_citation_and_image_have_the_version_of_the_package(cargo: dict[str, Any]) -> None:
    version = cargo["package"]["version"]
    released = re.findall(r"^## (\d\S*) \((\d{4}-\d\d-\d\d)\)$", read(ROOT / "CHANGELOG.md"), re.MULTILINE)
    citation = load_yaml(ROOT / "CITATION.cff")
    assert released[0] == (version, str(citation["date-released"]))
    assert citation["version"] == version
    assert f"FROM rust:{cargo['package']['rust-version']}-" in read(ROOT / "Dockerfile")


def test_addresses_are_of_one_repository(pyproject: dict[str, Any], cargo: dict[str, Any]) -> None:
    repository = cargo["package"]["repository"]
    urls = pyproject["project"]["urls"]
    assert urls["Source"] == repository
    assert urls.pop("Paper") == f"https://arxiv.org/abs/{ARXIV}"
    assert all(url.startswith(repository) for url in urls.values())
    for url in urls.values():
        _, _, path = url.partition("/main/")
        assert (ROOT / path).exists(), url


def test_readme_and_citation_name_the_paper_by_its_number() -> None:
    paper = load_yaml(ROOT / "CITATION.cff")["preferred-citation"]
    assert paper["url"] == f"https://arxiv.org/abs/{ARXIV}"
    assert paper["identifiers"][0]["value"] == f"arXiv:{ARXIV}"
    assert f"[arXiv:{ARXIV}](https://arxiv.org/abs/{ARXIV})" in read(ROOT / "README.md")


def test_image_copies_what_the_wheel_is_made_of() -> None:
    copied = {
        name
        for line in re.findall(r"^COPY (.*) \S+$", read(ROOT / "Dockerfile"), re.MULTILINE)
        for name in line.split()
    }
    ignored = read(ROOT / ".dockerignore").splitlines()
    assert copied == {line.removeprefix("!") for line in ignored if line.startswith("!")}
    assert all((ROOT / name).exists() for name in copied)


def test_links_of_the_readme_are_absolute_for_the_package_index() -> None:
    text = re.sub(r"^```.*?^```", "", read(ROOT / "README.md"), flags=re.DOTALL | re.MULTILINE)
    targets = re.findall(r"\]\(([^)\s]+)\)", text)
    assert len(targets) > 20
    assert [target for target in targets if not target.startswith("https://")] == []
    assert len(list(links(Path("README.md")))) > 20, "links into this repository, which tests/docs follows"
