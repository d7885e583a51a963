"""The six content languages of the Robot Companion, one module each; `companion.design` has
them by name.
"""
