"""Kills processes of a run at random instants until it is done.

See `PYTHONPATH=tests/helpers python tests/evaluation/chaos.py --help`.

The same run is made twice, undisturbed and disturbed; their records must be the same. A killed driver is started again,
as its user would; killed workers and agents are the driver's business.
"""

import argparse
import json
import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from contextlib import closing, suppress
from pathlib import Path

from processes import children

from evonav.agents.hosting import forking
from evonav.decision.vlm.mock_answers import mock_answer
from evonav.decision.vlm.mock_server import MockServer, serving
from evonav.evaluation.records.store import FILE_NAME, RunStore
from evonav.parallel.local import PROCESS_NAME

VICTIMS = {
    "driver": None,
    "worker": PROCESS_NAME,
    "agent": forking.PROCESS_NAME,
    "fork server": forking.SERVER_NAME,
}
"""Names of processes."""


def num_recorded(run_dir):
    path = run_dir / FILE_NAME
    if not path.exists():
        return 0
    with suppress(sqlite3.Error), closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=5.0)) as database:
        return database.execute("SELECT count(*) FROM timings").fetchone()[0]
    return 0


def disturb(command, run_dir, num_stages, num_kills, seed, environment=None):
    """Runs a command until it ends by itself, killing its processes meanwhile.

    Returns:
        Kills by victim.
    """
    draw = random.Random(seed)
    moments = sorted(draw.sample(range(num_stages - 1), num_kills))
    kills = Counter()

    def start():
        quiet = subprocess.DEVNULL
        return subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet, env=environment)

    driver = start()
    try:
        for moment in moments:
            while num_recorded(run_dir) < moment:
                assert driver.poll() is None, f"the run ended by itself with {driver.returncode}"
                time.sleep(0.02)
            time.sleep(draw.uniform(0.0, 1.0))
            victim = draw.choice(sorted(VICTIMS))
            part = VICTIMS[victim]
            among = (
                [driver.pid]
                if part is None
                else [pid for pid, line in children(driver.pid).items() if line.startswith(f"{part}\n")]
            )
            if not among or driver.poll() is not None:
                victim, among = "driver", [driver.pid]
            with suppress(ProcessLookupError):
                os.kill(draw.choice(among), signal.SIGKILL)
            kills[victim] += 1
            if victim == "driver":
                driver.wait(timeout=60)
                driver = start()
        while driver.wait() not in (0, 3):  # 3: incomplete
            driver = start()
    finally:
        driver.kill()
        driver.wait()
    return kills


def texts(run_dir):
    with RunStore(run_dir) as store:
        return [*store.record_texts(), *(plan.model_dump_json() for plan in store.floor_plans())]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tasks", required=True)
    parser.add_argument("--agents", default="fu")
    parser.add_argument("--limit", type=int, default=60)
    parser.add_argument("--workers", default="2")
    parser.add_argument("--episodes-at-once", type=int, default=1)
    parser.add_argument("--latency", type=float, help="of a mock model that decides, in seconds; default: rules decide")
    parser.add_argument("--retries", default="5", help="enough that no stage uses them up")
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    server = MockServer(lambda request: {"text": mock_answer(request), "hang_s": options.latency or 0.0})
    server.requests = None
    with serving(server):
        campaign(options, [] if options.latency is None else ["--decision", "vlm", "--model", "mock"], server.url)


def campaign(options, decision, url):
    """Makes both runs, and tells how they differ."""
    evonav = str(Path(sys.executable).with_name("evonav"))
    command = [evonav, "evaluate", "--agent", options.agents, "--tasks", options.tasks, "--limit", str(options.limit)]
    command += ["--workers", options.workers, "--set", f"episodes_at_once={options.episodes_at_once}"]
    command += [*decision, "--base-url", url] if decision else []
    command += ["--set", f"num_retries={options.retries}", "--out"]
    whole, disturbed = options.out / "whole", options.out / "disturbed"
    began_s = time.monotonic()
    subprocess.run([*command, str(whole)], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    whole_s = time.monotonic() - began_s
    num_stages = num_recorded(whole)
    began_s = time.monotonic()
    kills = disturb([*command, str(disturbed)], disturbed, num_stages, options.kills, options.seed)
    with RunStore(disturbed) as store:
        retries = Counter(row.kind.value for row in store.failures() if row.is_retried)
    told = {
        "stages": num_stages,
        "kills": kills,
        "retries": retries,
        "seconds": [round(whole_s, 1), round(time.monotonic() - began_s, 1)],
        "records_equal": texts(whole) == texts(disturbed),
        "summaries_equal": (whole / "summary.json").read_bytes() == (disturbed / "summary.json").read_bytes(),
    }
    sys.stdout.write(json.dumps(told) + "\n")


if __name__ == "__main__":
    main()
