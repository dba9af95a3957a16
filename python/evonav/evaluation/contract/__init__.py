"""Check an agent against the contract of `evonav.agents.agent`."""
