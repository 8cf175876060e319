#pragma once

#include "core/measure/exact/reference.h"
#include "core/scene/scene_data.h"

namespace gridcast::measure {

/// The exact reference of a scene's data, whose meshes it keeps pointing at. Instances with an inactive
/// transform cannot be hit, by rule, so they are left out. Errors: those of exact::Reference::build,
/// kUnsupported when the rest pose bends a mesh (scene::flattened has the bent ones).
[[nodiscard]] Result<exact::Reference> reference_of(const scene::SceneData& data,
                                                    const std::stop_token& stop = {});

}  // namespace gridcast::measure
