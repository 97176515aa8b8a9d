"""The text of the page of photographs."""

TEXT = """\
# Photographs, and the same views rendered

Measured on {pictures} photographs of a hand-held walk past tags on walls, with {tags} tags detected by
the detector of the robots alone (`msrr detect` searches sharpened pictures as well), by
`python docs/make_photographs.py PICTURES CALIBRATION TAG_SIZE`, which wrote this page. The size of the
tags was taken to be {size} m; residuals in pixels do not depend on it.

## The map
`msrr map PICTURES --calibration camera.yaml --tag-size M --refine-lens --out DIR` finds where all tags
are and where the camera stood, from the detections alone, and writes

| file | content |
|---|---|
| `map.yaml` | poses and covariances of all tags in the frame of the one that was seen most often |
| `residuals.csv`, `residuals.png` | distances of all corners by size, angle, picture and tag |
| `map.png` | the tags and the places of the camera in 3-D |
| `camera.yaml` | the refined calibration in the form of ROS, which scenes take |

{maps}

Tags and pictures that contradict the rest are found by a test of the residuals
(`msrr_perception.mapping.consistency`), not by hand. The refined lens: {lens}.

`msrr_scenes.loading.tag_map_file.read_tag_map` reads `map.yaml`. A scene takes it for
the marker of a port, `units.b.markers: {{rear: map.yaml}}`; the
[tutorial](../tutorials/own_camera.md) shows the whole way.

## What the residuals are made of
{explained}

Corners are those of the AprilTag library. *Numbers* are the parameters that a term adds to the fit. *F* is
the sum of squares that the term explains per number, over the sum of squares that is left per degree of
freedom: about 1 for a term that explains nothing.

- **The start.** A flat tag allows two poses. If some tags start at the wrong one, the bundle adjustment
  ends in another minimum, with a median of some tenths of a pixel and an RMS of some pixels, worst where
  the walk closes its loop. So the first guess tries both poses of every tag in all views, and the
  adjustment begins with a loss that does not yet ignore large residuals.
- **Distortion beyond the board.** A calibration from boards in the middle of the frame fits these, and
  extrapolates to tags near the border, worst with k3. `msrr calibrate` fits no more coefficients than
  the pictures determine; `--refine-lens` fits the lens and the map together.
- **Nothing moved.** The tags on the two doors agree with all others, and so do tags 11 and 13.
- **Sizes** agree within about 2 %, and explain little.
- **Shape.** Corners are off the flat square, the same in all pictures: paper on a wall is not flat.
  This is the largest part that is explained. A tag whose sheet is bent most can be left out for it.
- **A shear of every picture**, as rows that are exposed one after the other would make it while a hand
  moves.
- **The rest** is larger than the noise of rendered corners. Motion blur is part of it: the tag in one
  picture that both maps leave out is smeared by some pixels.

## Rendered as photographed
The mapped tags from the fitted places, through the fitted lens, with what was fitted to the
photographs:
{sensor}.
Black and white of each picture are those of its tags. The rendered pictures go the same way: detected,
mapped, measured.

{both}

Recall and the width of edges agree; **the residuals do not**: rendered ones are several times smaller. What
is missing, and why it was not added:

- **Bent paper.** A plate is a flat square, here and on the robot, where it is glued to a rigid body.
- **Rolling shutter.** The cameras of scenes have it (`rolling_shutter_ms`), but the walk of the hand
  during the readout is not known: motion blur does not tell its direction.
- **The processing in the phone.** The pictures were reduced fourfold and compressed, and were probably
  denoised and sharpened: their sharpest edges are narrower than rendered ones. What that does to a
  corner depends on all that is beside it, and is not documented. The cameras of the robots deliver grey
  levels as they are.
- **Uneven light**, and lamps that bloom into the tags beside them: light here is one level for each
  picture.

So corners on such photographs are to be trusted to about 0.2 px, not to the 0.03 px of rendered frames.
"""
