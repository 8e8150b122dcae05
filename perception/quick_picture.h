// A plain colour picture of a scan, without rays of its own.
#pragma once

#include <vector>

#include "perception/camera.h"
#include "perception/geom_scanner.h"
#include "perception/picture.h"
#include "perception/scanner.h"

namespace dofusion {

// Matt surfaces in the colours of shaded_picture (perception/picture.h), lit by a distant lamp beside the viewer and a
// little from the viewer, without shadows; a flat face has one colour. Nothing hit is the table's colour in full light.
// A hundred times as fast as shaded_picture.
ColourImage quick_picture(const Scan& scan, const Pose& T_world_camera);

// The same of MuJoCo's geoms in their own colours; `geoms` are the scanner's.
ColourImage quick_picture(const GeomScan& scan, const std::vector<Geom>& geoms, const Pose& T_world_camera);

}  // namespace dofusion
