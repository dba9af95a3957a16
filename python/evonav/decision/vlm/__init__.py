"""Vision-language models behind OpenAI-compatible endpoints: the client, its cache and its costs."""
