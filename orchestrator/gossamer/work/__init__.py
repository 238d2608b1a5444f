"""What the functions of this package do: call what their commands call, and return results instead of printing them.

Arguments are those of the commands' own functions, as ``table.values`` gives them.
"""
