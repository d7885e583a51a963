"""`roco`, the operator's command line. It imports no agent: it knows the run folder's files, and
what a system adds.
"""
