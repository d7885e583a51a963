"""The six content languages of the Robot Companion, one module each (paper, section 5.6)."""
