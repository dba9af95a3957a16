"""Run agents on tasks. Nothing is imported here, so that workers can start before anything else is imported."""

from evonav.parallel.local import WorkerProgram

PROGRAM = WorkerProgram("evonav.evaluation.run.worker:EpisodeWork", prelude="evonav.agents.hosting.forking:fork_beside")
"""The code of workers."""
