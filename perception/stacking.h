// What objects stand on.
#pragma once

#include <optional>
#include <vector>

#include "perception/unknown_recovery.h"

namespace dofusion {

struct Body {
  ObjectView view;
  FittedShape shape;
};

// The shape of an object on the table or on one of the bodies below it, whichever explains the readings best; one that
// would tip over or reach into a body counts less. nullopt if no shape is as high as options.min_size.
std::optional<FittedShape> fit_on_support(const ObjectView& view, const std::vector<Body>& bodies,
                                          const ShapeEvidence& evidence, const UnknownRecoveryOptions& options);

// What carries others is often hidden by them: lengthens bodies along their own axes until what they carry is
// balanced, where the image does not contradict it and nothing else is in the way.
void extend_hidden_supports(std::vector<Body>& bodies, const ShapeEvidence& evidence,
                            const UnknownRecoveryOptions& options);

bool is_high_enough(const TriangleMesh& mesh, double min_size);

}  // namespace dofusion
