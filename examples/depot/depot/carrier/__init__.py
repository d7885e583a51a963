"""Common parts of both robots: memory, behaviours and wheels of an agent that carries. No agent
itself.
"""
