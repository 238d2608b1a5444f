"""What the functions of this package return: data for xarray, where the files are, and a display for notebooks.

A result is a path too, of its folder or its main file: ``gossamer.twin(gossamer.run("damaged"))``.
"""
