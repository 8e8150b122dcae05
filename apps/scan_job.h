// Scenes to a BOP dataset of synthetic scans, resumable.
#pragma once

#include <cstdint>
#include <string>

#include <nlohmann/json.hpp>

#include "apps/scan_mjcf.h"
#include "perception/camera.h"
#include "perception/synthetic_view.h"
#include "stability/generation.h"

namespace dofusion {

struct ScanJob {
  std::string data, data_split;  // scenes of this dataset, all or those of one split …
  MjcfScanOptions mjcf;          // … or, if its `file` is set, that scene …
  GenerationOptions generation;  // … or, if both are empty, new ones; its seed is not used but `seed`
  std::int64_t count = 0;        // scenes; 0: all of the dataset, or 10 new ones
  int cameras = 1;               // viewpoints a scene, unless the MJCF file's are used
  Camera camera = default_camera();
  SyntheticViewOptions view;
  double distance = 0.0;  // metres from sampled viewpoints to the objects' centre; 0: 0.7, or as far as the size of an
                          // MJCF scene's objects asks for (viewing_distance)
  bool fine_rgb = false;  // colour pictures with soft shadows
  bool clouds = false;    // PCD files as well
  std::string split = "test";
  std::uint64_t seed = 0;
  int threads = 1;
  std::string out;
};

struct ScanResult {
  std::int64_t scenes = 0, images = 0, models = 0;
  std::int64_t resumed = 0;        // of the images, made by earlier runs
  double seconds = 0.0;            // of scanning: reading, generation and models come before
  double images_per_second = 0.0;  // of this run
  double processor_ms_per_image = 0.0;
  double distance = 0.0;  // metres, as the job says or as was chosen; 0: the MJCF file's cameras were used
};

// Works in OUT.partial (apps/scan_folder.h), which becomes OUT when everything is there; the bytes of OUT depend on the
// job alone, not on threads and kills. Depth is written in steps of 0.1 mm, and of 1 or 10 mm where the objects are
// more than 3.2 or 32 m away. Throws InputError on bad input, naming the scene if one cannot be scanned: more than 253
// objects, a camera under the table, behind a plane or inside something, an object outside all images; OUT.partial is
// then deleted, since the same job cannot succeed. Throws Interrupted if the user ends the program; OUT.partial stays.
ScanResult scan_scenes(const ScanJob& job);

nlohmann::ordered_json to_json(const ScanJob& job, const ScanResult& result);  // for --json

}  // namespace dofusion
