"""SYNTHETIC specimen: a sensor material of no fitted family, and the datasets measured on it."""

from .datasets import Dataset, dataset, random_reversals
from .files import write_dataset, write_datasets
from .material import SpecimenParams, VirtualSpecimen
from .records import specimen_record

__all__ = [
    "Dataset",
    "SpecimenParams",
    "VirtualSpecimen",
    "dataset",
    "random_reversals",
    "specimen_record",
    "write_dataset",
    "write_datasets",
]
