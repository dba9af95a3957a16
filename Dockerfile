# evonav on the CPU, without Rust or sources:
#
#     docker build --tag evonav .
#     mkdir -p out
#     docker run --rm --user "$(id -u)" --volume "$PWD/out:/home/evonav/out" evonav demo
#
# `make test` does not build it: the job `docker` of .github/workflows/ci.yml does.
FROM rust:1.88-slim-bookworm AS build
RUN apt-get update && apt-get install --yes --no-install-recommends python3-venv && rm -rf /var/lib/apt/lists/*
RUN python3 -m venv /opt/maturin && /opt/maturin/bin/pip install --no-cache-dir "maturin>=1.9.4,<2"
WORKDIR /evonav
COPY Cargo.toml Cargo.lock pyproject.toml README.md LICENSE ./
COPY rust rust
COPY python python
RUN /opt/maturin/bin/maturin build --release --locked --out /dist

FROM python:3.13-slim-bookworm
RUN --mount=type=bind,from=build,source=/dist,target=/dist \
    pip install --no-cache-dir --no-compile "$(echo /dist/evonav-*.whl)[viz]"
ENV MPLCONFIGDIR=/tmp/matplotlib
RUN useradd --create-home evonav
USER evonav
WORKDIR /home/evonav
ENTRYPOINT ["evonav"]
CMD ["--help"]
