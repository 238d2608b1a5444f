"""Write results as a run leaves them."""

from gossamer_orchestrator.results.files import CSV, NETCDF, make_folder, save_csv


def save_results(data, folder):
    """Write ``results.nc`` and ``results.csv`` into a folder, which is made if needed; return both paths."""
    make_folder(folder)
    data.to_netcdf(folder / NETCDF, engine="scipy", format="NETCDF3_64BIT")
    save_csv(data, folder)
    return folder / NETCDF, folder / CSV
