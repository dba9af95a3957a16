"""Describe a set of tasks in Croissant 1.0, which `mlcroissant` and dataset search engines read.

The format is MLCommons' (https://docs.mlcommons.org/croissant/docs/croissant-spec.html). Paths are relative, so the
description holds for the folder as it is downloaded.
"""

from typing import Any

from evonav.report.cards.task_set import TaskSet

CROISSANT_NAME = "croissant.json"
CONFORMS_TO = "http://mlcommons.org/croissant/1.0"
METADATA_NAME = "metadata.jsonl"

_TERMS = [
    "citeAs",
    "column",
    "extract",
    "field",
    "fileProperty",
    "fileObject",
    "fileSet",
    "format",
    "includes",
    "isLiveDataset",
    "jsonPath",
    "key",
    "md5",
    "parentField",
    "path",
    "recordSet",
    "references",
    "regex",
    "repeated",
    "replace",
    "separator",
    "source",
    "subField",
    "transform",
    "equivalentProperty",
    "samplingRate",
]
_CONTEXT = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "dct": "http://purl.org/dc/terms/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "sc": "https://schema.org/",
    "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
    **{term: f"cr:{term}" for term in _TERMS},
}
_STAGE_COLUMNS = {
    "task_id": ("sc:Text", "Task of the stage: the name of its folder."),
    "stage": ("sc:Integer", "Number of the stage in its task, from 1."),
    "num_stages": ("sc:Integer", "Number of stages of the task."),
    "num_rooms": ("sc:Integer", "Number of rooms of the house."),
    "category": ("sc:Text", "Category of the target, in ProcTHOR's names."),
    "basic_instruction": ("sc:Text", "Instruction that names the target's category and place."),
    "appearance_instruction": ("sc:Text", "Instruction that describes how the target looks."),
    "unified_instruction": ("sc:Text", "Instruction with the target's look and place."),
    "writer": ("sc:Text", "Program or model that wrote the instructions."),
}
_TASK_FIELDS = {
    "task_id": ("$.task_id", "sc:Text", "Task: the name of its folder."),
    "split": ("$.split", "sc:Text", "Split of the source houses."),
    "seed": ("$.seed", "sc:Integer", "Seed of the task."),
    "num_stages": ("$.num_stages", "sc:Integer", "Number of stages."),
    "house": ("$.house.name", "sc:Text", "Name of the source house."),
    "house_sha256": ("$.house.sha256", "sc:Text", "SHA-256 of the first stage's house."),
    "num_rooms": ("$.house.num_rooms", "sc:Integer", "Number of rooms of the house."),
    "num_objects": ("$.house.num_objects", "sc:Integer", "Number of objects of the house."),
    "start_position_m": ("$.start_pose.position_m", "sc:Float", "Where the agent starts: x, y (up), z in metres."),
}
_ORACLE_FIELDS = {
    "stage": ("$.stage", "sc:Integer", "Number of the stage in its task, from 1."),
    "outcome": ("$.evolution.outcome", "sc:Text", "Whether the house changed before the stage, and why not."),
    "mode": ("$.evolution.mode", "sc:Text", "Mode of the change."),
    "changed_room_id": ("$.evolution.room_id", "sc:Text", "Room that changed."),
    "target_id": ("$.target.id", "sc:Text", "Target, by the simulator's id."),
    "target_category": ("$.target.category", "sc:Text", "Category of the target."),
    "target_room_id": ("$.target.room_id", "sc:Text", "Room of the target."),
    "target_position_m": ("$.target.position_m", "sc:Float", "Centre of the target: x, y (up), z in metres."),
    "is_relocated_ever": ("$.target.is_relocated_ever", "sc:Boolean", "True if a change so far moved the target."),
    "reference_path_length_m": ("$.reference_path_length_m", "sc:Float", "Length of the reference path in metres."),
}
_LISTS = ("start_position_m", "target_position_m")


def croissant(tasks: TaskSet, sha256s: dict[str, str], about: dict[str, str]) -> dict[str, Any]:
    """Describe the folder of a set of tasks.

    Args:
        sha256s: Checksum of each file at the top of the folder, by name.
        about: Name, description, licence, date and other properties of the set, by their names in schema.org.
    """
    return {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": CONFORMS_TO,
        "isLiveDataset": False,
        **about,
        "distribution": [
            *(_file(name, sha256) for name, sha256 in sha256s.items()),
            _files("task-files", "application/json", "*/task.json", "Header of each task."),
            _files("oracle-files", "application/json", "*/oracle/*.json", "Answers and changes of each stage."),
            _files("public-files", "application/json", "*/public/*.json", "Goal of each stage."),
            _files("image-files", "image/png", "*/public/*.png", "Reference image of each stage."),
            _files("house-files", "application/gzip", "*/houses/*.json.gz", "House of each stage, ProcTHOR JSON."),
        ],
        "recordSet": [_images(), _stages(), _tasks(), _oracle_stages()],
    }


def _file(name: str, sha256: str) -> dict[str, Any]:
    form = "application/jsonlines" if name == METADATA_NAME else "application/json"
    return {
        "@type": "cr:FileObject",
        "@id": name,
        "name": name,
        "contentUrl": name,
        "encodingFormat": form,
        "sha256": sha256,
    }


def _files(name: str, form: str, pattern: str, description: str) -> dict[str, Any]:
    return {
        "@type": "cr:FileSet",
        "@id": name,
        "name": name,
        "description": description,
        "encodingFormat": form,
        "includes": pattern,
    }


def _images() -> dict[str, Any]:
    path = _of_file("image-files", "fullpath", "^(.*)$")
    fields = [
        _field("images", "path", "sc:Text", "Path of the image.", path),
        _field("images", "content", "sc:ImageObject", "The image.", _of_file("image-files", "content")),
    ]
    return _records("images", "Reference images by their paths.", "path", fields)


def _stages() -> dict[str, Any]:
    path = _field("stages", "file_name", "sc:Text", "Path of the reference image.", _column("file_name"))
    path["references"] = {"field": {"@id": "images/path"}}
    image = {"field": {"@id": "images/content"}}
    fields = [
        path,
        *(_field("stages", name, kind, text, _column(name)) for name, (kind, text) in _STAGE_COLUMNS.items()),
        _field("stages", "image", "sc:ImageObject", "Reference image: what is seen where the reference ends.", image),
    ]
    return _records("stages", "What an agent is given in each stage.", "file_name", fields)


def _tasks() -> dict[str, Any]:
    fields = [_json_field("tasks", "task-files", name, *rest) for name, rest in _TASK_FIELDS.items()]
    return _records("tasks", "Header of each task, from TASK/task.json.", "task_id", fields)


def _oracle_stages() -> dict[str, Any]:
    name = "oracle_stages"
    path = _of_file("oracle-files", "fullpath", r"^(.*)\.json$")
    task_id = _of_file("oracle-files", "fullpath", "^([^/]+)/")
    fields = [
        _field(name, "path", "sc:Text", "Path of the file, without its suffix.", path),
        _field(name, "task_id", "sc:Text", "Task of the stage: the name of its folder.", task_id),
        *(_json_field(name, "oracle-files", each, *rest) for each, rest in _ORACLE_FIELDS.items()),
    ]
    return _records(name, "Answers: target and change of each stage, from TASK/oracle/stage_k.json.", "path", fields)


def _records(name: str, description: str, key: str, fields: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "@type": "cr:RecordSet",
        "@id": name,
        "name": name,
        "description": description,
        "key": {"@id": f"{name}/{key}"},
        "field": fields,
    }


def _json_field(records: str, files: str, name: str, path: str, kind: str, description: str) -> dict[str, Any]:
    source = {"fileSet": {"@id": files}, "extract": {"jsonPath": path}}
    return _field(records, name, kind, description, source)


def _field(records: str, name: str, kind: str, description: str, source: dict[str, Any]) -> dict[str, Any]:
    return {
        "@type": "cr:Field",
        "@id": f"{records}/{name}",
        "name": name,
        "description": description,
        "dataType": kind,
        **({"repeated": True} if name in _LISTS else {}),
        "source": source,
    }


def _column(name: str) -> dict[str, Any]:
    return {"fileObject": {"@id": METADATA_NAME}, "extract": {"column": name}}


def _of_file(files: str, name: str, pattern: str | None = None) -> dict[str, Any]:
    transform = {} if pattern is None else {"transform": {"regex": pattern}}
    return {"fileSet": {"@id": files}, "extract": {"fileProperty": name}, **transform}
