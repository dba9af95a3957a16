"""Tables, maps and pages made from the records of a run, and from nothing else."""

from evonav.report.pages.run_page import write_report
from evonav.report.run import RecordedRun, load_run

__all__ = ["RecordedRun", "load_run", "write_report"]
