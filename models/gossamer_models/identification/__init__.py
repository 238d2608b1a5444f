"""Identification: records of strain and resistance to a sensor artifact."""

from .choices import OPTIONS, choose
from .fractional import FractionalChoice, fit_fractional
from .judge import predict_output, recover_strain
from .plots import everett, plot_everett, plot_history, plot_loop, plot_plane, plot_residual, save_pictures
from .preisach import Fit, fit_preisach
from .quality import Determination, Errors, covariance, determinations, doubts, errors
from .records import Columns, Record, read_record, read_records
from .run import Identified, identify_files, settings_for, training_rows
from .settings import FitSettings

__all__ = [
    "Columns",
    "Record",
    "read_record",
    "read_records",
    "OPTIONS",
    "choose",
    "FitSettings",
    "FractionalChoice",
    "fit_fractional",
    "Fit",
    "fit_preisach",
    "Identified",
    "identify_files",
    "settings_for",
    "training_rows",
    "Errors",
    "errors",
    "Determination",
    "covariance",
    "determinations",
    "doubts",
    "predict_output",
    "recover_strain",
    "everett",
    "plot_everett",
    "plot_history",
    "plot_loop",
    "plot_plane",
    "plot_residual",
    "save_pictures",
]
