"""Run agents on tasks. Nothing is imported here, so that workers can start before anything else is imported."""

from evonav.parallel.local import Program

PROGRAM = Program("evonav.evaluation.run.worker:EpisodeWork", prelude="evonav.agents.hosting.forking:fork_beside")
"""The code of workers."""
