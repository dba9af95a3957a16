"""The front door: what `import evonav` offers beside the contract of agents. Import these names from `evonav`."""
