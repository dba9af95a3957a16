"""Episodes of an agent in the toy house."""

from types import SimpleNamespace

from toy_house import ToySimulator

from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.protocol import ProtocolConfig
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.world.pose import Pose

START = Pose(1.0, 0.9, 3.0, 0.0)


def run(agent, *stages, start=START, protocol=None, perception=None, seed=7, size_px=48):
    """Return the records of an episode of these stages; each of them is scored."""
    spec = EpisodeSpec("toy", "toy", start, stages)
    simulator = ToySimulator(size_px, size_px)
    perception = perception or GroundTruthPerception()
    episode = Episode(spec, "a", agent, simulator, perception, protocol or ProtocolConfig(), seed)
    records = [outcome.record for outcome in episode.run()]
    assert all(record.is_scored for record in records), [record.error for record in records]
    return records


def belief_of(agent):
    """Return what an agent believes now: values that do not change with it."""
    found = agent.explain()
    drawn = found.map_belief()
    return SimpleNamespace(
        entries=found.entries(),
        candidate_ids=found.candidate_ids,
        queries=found.questions,
        places=found.place_belief(),
        cells=drawn.cells,
        map_frame=drawn.map_frame,
        frontiers=list(drawn.frontiers),
        explored=drawn.explored,
    )


def noted(agent):
    """Return a list to which each round of an agent is added: stage, observation, action, and what it then believes."""
    rounds, numbers = [], []
    act, begin_stage = agent.act, agent.begin_stage

    def noting(observation):
        action, said = act(observation), agent.explain()
        belief = belief_of(agent)
        rounds.append(
            SimpleNamespace(stage=numbers[-1], observation=observation, action=action, belief=belief, said=said)
        )
        return action

    agent.act = noting
    agent.begin_stage = lambda stage: numbers.append(stage.stage) or begin_stage(stage)
    return rounds


def rounds_of(agent, *stages, **options):
    """Return the records, and each round's stage, belief, explanation and action."""
    rounds = noted(agent)
    records = run(agent, *stages, **options)
    return records, [(one.stage, one.belief, one.said, one.action) for one in rounds]
