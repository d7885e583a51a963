"""What skills are made of: the language between a skill and the control loop, motions, senses, and
what ex knows.

It knows no task. A skill turns one robot command (RC) into motions of the loop, from what the
receptor saw last; those of a task are in companion.tasks (`perform`).
"""
