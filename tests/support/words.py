"""Commands as lines of text."""

import shlex

#: Short forms in commands: the built-in sensor, and an indenter with a load.
SHORT = {"WTS": "wts-0614-34", "BALL": "--indenter sphere:radius=5mm --load 1N"}


def split_command(command):
    for name, words in SHORT.items():
        command = command.replace(name, words)
    return shlex.split(command)


def split_table(text):
    """Pairs of the two texts that ` | ` separates in each line."""
    return [line.split(" | ", 1) for line in text.strip().splitlines()]
