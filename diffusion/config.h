// What a placement model is: its presets, sizes and noise, as JSON in and out.
#pragma once

#include <string>
#include <vector>

namespace dofusion {

enum class Preset {
  kDefault,  // residual pose in the world frame, continuous noise, one graph (see README.md in this folder)
  kPaper,    // the paper to the letter: predicted body-frame noise, discrete schedule, DGCNN with dynamic graphs
};
std::string to_string(Preset preset);
Preset preset_from_string(const std::string& name);  // throws std::invalid_argument naming the choices

// Lengths are in normalised units (augmented_cloud.h), angles in radians.
struct ModelConfig {
  Preset preset = Preset::kDefault;
  int points = 192;                              // of one scene's cloud in training, shared out among its objects
  int neighbours = 16;                           // k of the graph
  std::vector<int> widths = {64, 64, 128, 256};  // channels of the edge convolutions; multiples of 32
  int embedding = 512;                           // channels that are pooled over the points
  int hidden = 512;                              // of the MLP
  int noise_frequencies = 8;                     // sine and cosine pairs of the logarithm of the noise scale
  double sigma_min = 0.005;
  double sigma_max = 3.0;
  int schedule_steps = 100;     // T of the discrete schedule (paper)
  double distance_limit = 1.0;  // the SDF channel is cut off here, and is this where there is no other
  std::vector<double> contact_scales = {0.1, 0.01};  // heights and distances also enter as v / (|v| + scale)
  bool directions = false;    // surface normals and directions of the distance enter as well
  double query_share = 0.0;   // of the points, on the query; 0: all objects get equal shares
  double sharp_share = 0.0;   // of each object's points, on its edges and corners
  int point_head = 0;         // hidden channels of the forces on the query's points (point_head.h); 0: none
  bool equivalent = false;    // the target in training is the nearest of a symmetric shape's equal poses
  double perception_noise = 0.0;  // in training, of what stands around the query: training_data.h
  bool use_sdf = true;                               // ablations of table V
  bool use_pose = true;

  int point_features() const;  // channels per point that the network sees
  int pose_features() const;   // per scene: rotation matrix (9) and height, or position and rotation vector (paper)
};

ModelConfig make_config(Preset preset);

std::string to_json(const ModelConfig& config);

// Reads JSON text; keys that are absent keep the value of `base`. Throws InputError naming `source` and the key that
// is unknown, of a wrong type or out of range.
ModelConfig config_from_json(const std::string& text, const std::string& source, ModelConfig base = {});

// Throws InputError naming `source` and the field if a value makes no sense.
void check(const ModelConfig& config, const std::string& source);

}  // namespace dofusion
