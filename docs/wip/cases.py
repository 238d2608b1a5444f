import sys, time
from pathlib import Path
from gossamer.descriptions import load_campaign
from gossamer_models.campaign import run_campaign
if __name__ == "__main__":
    out = Path("/tmp/w/net/out/campaigns")
    for name in ("detector_wide", "detector_nominal"):
        plan, source = load_campaign(Path(f"/tmp/w/networks/orchestrator/campaigns/{name}.toml"))
        for p, end in ((plan.coarse, "_coarser"), (plan, "")):
            s = run_campaign(p, out / f"{name}{end}.zarr", workers=1, source=source.text)
            print(time.strftime("%H:%M:%S"), name, end, s, flush=True)
