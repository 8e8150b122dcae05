// The work of dofusion-train: datasets in, a model file out.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "diffusion/trainer.h"

namespace dofusion {

struct TrainSettings {
  std::string preset = "default", config_path, held_out_shape;
  std::string from;  // a model file to begin with: its configuration in place of the preset's, and its weights
  std::vector<std::string> data;
  std::vector<std::string> tasks;  // scenes of these alone; empty: all
  int validation = 100;  // scenes of the data's validation split that are sampled and settled; 0: none
  int rank = 0, processes = 1;
  std::string rendezvous;  // host:port of rank 0
  TrainOptions options;
};

// Trains, with progress on stderr; FILE.checkpoint, FILE.csv and FILE.svg (the curves) appear beside the model. Returns
// what was done. Throws InputError on bad input, Interrupted (program.h) after Ctrl-C, when everything is written.
nlohmann::json train_model(const TrainSettings& settings);

}  // namespace dofusion
