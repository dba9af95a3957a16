"""Validate tasks: check their files, records, physics, reference views and paths again from the start."""

from evonav.generation.validation.problems import KINDS, Problem, ProblemKind, Report
from evonav.generation.validation.validate import FolderReport, validate_files, validate_folder, validate_task

__all__ = [
    "KINDS",
    "FolderReport",
    "Problem",
    "ProblemKind",
    "Report",
    "validate_files",
    "validate_folder",
    "validate_task",
]
