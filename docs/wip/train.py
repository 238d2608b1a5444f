import sys, time, json
from dataclasses import replace
from pathlib import Path
from gossamer_models.campaign import read_campaign
from gossamer_models.detector.posterior_records import Training
from gossamer_models.detector.posterior_training import train_posterior
name, steps = sys.argv[1], int(sys.argv[2])
out=Path("/tmp/w/net/out/campaigns")
data, coarse = read_campaign(out/f"detector_{name}.zarr"), read_campaign(out/f"detector_{name}_coarser.zarr")
t=replace(Training.of(data), steps=steps)
print(t, flush=True)
t0=time.time(); last=[0]
def progress(x):
    if time.time()-last[0]>60: last[0]=time.time(); print(time.strftime("%H:%M:%S"), f"{x:.3f}", flush=True)
a=train_posterior(data,t,coarse,None,progress)
print("seconds", time.time()-t0, "cpu", time.process_time())
a=replace(a, provenance={"command": f"gossamer train detector_{name} --steps {t.steps}", **a.provenance})
a.write(Path(f"/tmp/w/net/out/{name}{'_short' if steps<500 else ''}.json"))
for l in a.losses: print([round(x,2) for x in l[::10]])
