#pragma once
// A small scene that can be posed in every way.

#include "core/scene/update.h"
#include "tests/support/shapes.h"

namespace gridcast::test {

/// Nodes: 0 arm and its child 1 hand are the joints of skin 0, which bends the torus (mesh 0, shown by node
/// 2), whose only morph target makes it larger; 3 shows a box (mesh 1). Animation 0 turns the hand for 2 s.
inline scene::SceneData puppet() {
  scene::SceneData data;
  TriangleMesh bent = torus(12, 8);
  scene::MeshDeformation deformation;
  deformation.influences = 4;
  deformation.morph_targets.resize(1);
  for (const Vec3f& p : bent.positions) {
    const float share = 0.5F + 0.5F * p.x / 1.3F;
    deformation.joints.insert(deformation.joints.end(), {0, 1, 0, 0});
    deformation.weights.insert(deformation.weights.end(), {1.F - share, share, 0.F, 0.F});
    deformation.morph_targets[0].positions.push_back(0.25F * p);
  }
  data.meshes = {share(std::move(bent)), share(box({-1, -1, -1}, {1, 1, 1}))};
  data.deformations = {deformation, {}};
  data.nodes.resize(4);
  data.nodes[1].parent = 0;
  data.skins.push_back({"bones", {0, 1}, {Affine{}, Affine{Mat3d(1.0), Vec3d(0.0, -0.7, 0.1)}}, kInvalidId});
  data.instances.resize(2);
  data.instances[0] = {scene::SharedText("torus"), {}, 0, 2, 0};
  data.instances[1] = {scene::SharedText("box"), {}, 1, 3};
  data.animations = {{"wave",
                      {{1,
                        scene::AnimationPath::kRotation,
                        scene::Interpolation::kLinear,
                        {0.F, 2.F},
                        {0, 0, 0, 1, 0, 0.3F, 1, 1}}}}};
  return data;
}

/// An animated hand, a moved and scaled box, a morphed torus.
inline scene::SetPose waving() {
  scene::SetPose pose;
  pose.animation = scene::AnimationTime{0U, 0.7};
  pose.nodes = {{3U, Affine{Mat3d(0.3), Vec3d(0.1, 0.2, 5.0)}}};
  pose.weights = {{0, {0.35}}};
  return pose;
}

/// Joints by their matrices, on top of the present pose: its nodes stay.
inline scene::SetPose stretched() {
  scene::SetPose pose;
  pose.base = scene::PoseBase::kPresent;
  pose.skins = {{0U, {Affine{Mat3d(1.1), Vec3d(0.1)}, Affine{Mat3d(0.9), Vec3d(0.0, 0.3, 0.7)}}}};
  return pose;
}

}  // namespace gridcast::test
