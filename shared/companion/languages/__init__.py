"""The six content languages of the Robot Companion, one module each; `companion.all_languages` has
them by name.
"""
