"""SYNTHETIC specimen: a sensor material of no fitted family, and the datasets measured on it."""

from .datasets import Dataset, dataset, random_reversals
from .files import write_dataset, write_datasets
from .specimen import SpecimenParams, VirtualSpecimen

__all__ = [
    "Dataset",
    "SpecimenParams",
    "VirtualSpecimen",
    "dataset",
    "random_reversals",
    "write_dataset",
    "write_datasets",
]
