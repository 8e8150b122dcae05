// Training: batches from datasets, gradients on several threads, checkpoints that a kill cannot spoil.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "diffusion/optimizer.h"
#include "diffusion/peers.h"
#include "diffusion/training_data.h"

namespace dofusion {

struct TrainOptions {
  std::string out;         // the model; FILE.checkpoint and FILE.csv appear beside it
  bool resume = false;     // go on from FILE.checkpoint
  double minutes = 0.0;    // planned training time, checkpoints' included; 0: no limit
  std::int64_t steps = 0;  // planned steps; 0: no limit. The schedule ends at whichever comes first
  std::uint64_t seed = 0;
  int threads = 1;
  int batch = 128;             // scenes in a step, of each process
  int micro_batch = 8;         // scenes that one thread works on at a time
  std::int64_t warm_up = 500;  // steps of rising learning rate
  OptimizerOptions optimizer;
  std::vector<float> parameters;     // to begin with, as in ModelFile; empty: drawn from the seed
  double report_seconds = 10.0;      // between calls of `report`
  double checkpoint_seconds = 30.0;  // between checkpoints
  double validate_minutes = 0.0;     // between calls of `validate`; 0: none but at the end
};

struct TrainReport {
  std::int64_t step = 0, samples = 0;
  double progress = 0.0;  // of the planned run, 0 to 1
  double seconds = 0.0;   // of training, over all resumed runs
  double seconds_left = 0.0;
  double samples_per_second = 0.0;  // since the last report
  double learning_rate = 0.0;
  double gradient_norm = 0.0;             // mean since the last report, before clipping
  double loss = 0.0;                      // mean since the last report
  std::array<double, 3> loss_by_noise{};  // at low, middle and high noise: thirds of the log scale; NaN if none
  double validation = std::numeric_limits<double>::quiet_NaN();  // what `validate` last said
};

// All may be left empty.
struct TrainCallbacks {
  std::function<void(const TrainReport&)> report;      // every TrainOptions::report_seconds
  std::function<bool(const TrainReport&)> keep_going;  // after every step; false: stop after writing the checkpoint
  // A figure of merit of the averaged parameters, for the log: say, the share of sampled poses that stand.
  std::function<double(const ModelConfig&, const std::vector<float>&)> validate;
};

struct TrainResult {
  bool finished = false;  // false: stopped by a callback, of this process or another
  TrainReport last;
  std::vector<float> losses;  // mean loss of every step of this run
};

// Trains and writes options.out (averaged weights) at every checkpoint and at the end. With `peers`, every process
// draws its own part of each step's scenes and all go along the same curve: N processes do what one does with N times
// the batch. The first one alone writes files, reads the checkpoint, validates and reports; its clock counts. Throws
// InputError if a file cannot be written, if the checkpoint belongs to other settings, or if neither minutes nor steps
// are given; std::runtime_error if the loss is not finite: the last checkpoint stays.
TrainResult train(const TrainingSet& data, const ModelConfig& config, const TrainOptions& options,
                  const std::string& record, const TrainCallbacks& callbacks = {}, Peers* peers = nullptr);

}  // namespace dofusion
