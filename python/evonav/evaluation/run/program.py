"""Name the code of an evaluation's workers, apart from it, so that they can start before anything else is imported."""

from evonav.parallel.local import Program

PROGRAM = Program("evonav.evaluation.run.worker:EpisodeWork", prelude="evonav.agents.hosting.forking:fork_beside")
