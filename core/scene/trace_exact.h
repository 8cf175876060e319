#pragma once

#include "core/math/hit.h"
#include "core/mesh/exact_test.h"
#include "core/scene/query_filter.h"
#include "core/scene/scene.h"

namespace gridcast::scene {

/// The closest hit of a valid ray in the real-number problem that the stored numbers pose, ties by
/// (instance_id, primitive_id). Its t is within 2^-52 of itself of the true one, u and v within 2^-13 of
/// theirs (a few 2^-53 of the distance over the triangle's size, but for ill-conditioned instances).
/// `best` starts as {tfar}.
void closest_hit_exact(const Scene& scene, const Ray& ray, const QueryFilter& filter, Hit& best);

/// The last step of that for hits that were found otherwise: `best` stays where `found` has none.
void finish_exact(const Ray& ray, mesh::ExactBest& found, Hit& best);

/// Whether a valid ray hits anything in that problem.
[[nodiscard]] bool any_hit_exact(const Scene& scene, const Ray& ray, const QueryFilter& filter);

}  // namespace gridcast::scene
