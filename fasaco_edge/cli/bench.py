"""``fasaco-edge bench``: placeholder"""


def add_to(commands, common):
    commands.add_parser("bench", parents=[common])
