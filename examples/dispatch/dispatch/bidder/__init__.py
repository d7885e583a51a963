"""Common parts of all bidders: memory, behaviours and devices of an agent that bids for a robot. No agent itself."""
