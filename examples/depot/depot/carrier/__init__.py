"""What both robots are: memory, behaviours and wheels of an agent that carries. No agent itself."""
