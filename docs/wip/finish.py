"""finish.py NAME: held-out figures into the artifact, and into the package of the clone."""
import sys
from dataclasses import replace
from pathlib import Path
from gossamer_models.campaign import read_campaign
from gossamer_models.detector import PosteriorArtifact
from gossamer_models.detector.posterior_records import Training
from gossamer_models.assessment.figures import errors, held_out_verdicts
name=sys.argv[1]; data=read_campaign(Path(f"/tmp/w/net/out/campaigns/detector_{name}.zarr"))
a=PosteriorArtifact.read(Path(f"/tmp/w/net/out/{name}.json"))
judged=held_out_verdicts(a,data,Training.of(data))
a=replace(a,held_out={k:errors(*v) for k,v in judged.items()})
a.write(Path(f"/tmp/w/networks/models/gossamer_models/detector/{name}.json"))
for k,v in a.held_out.items(): print(k,{x:round(float(y),3) for x,y in v.items()})
