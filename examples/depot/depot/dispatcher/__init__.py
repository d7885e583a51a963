"""a_dispatcher. Puts each order out to tender among the robots, and awards it to the one that is
soonest there.
"""
