"""The paper's multi-stage protocol: rollouts, metrics, records, runs."""
