#pragma once
#include <span>
#include <vector>

#include "Obstacles.h"

class btMultiBodyLinkCollider;

namespace jacket::bullet {

/// Present twist of a multibody's link; zero while Bullet has it asleep.
Vec6 twistOf(const btMultiBodyLinkCollider& collider);

/// Whether the link goes where its multibody is told to, or is not told to go: nothing that touches it can move it.
bool isPrescribed(const btMultiBodyLinkCollider& collider);

/// Gives the obstacles that are free links of multibodies their masses and free twists. Joints let one link move the
/// other: the links of one multibody are coupled, by the couplings returned (by index of the obstacles).
std::vector<BodyCoupling> coupleLinks(std::span<Obstacle> obstacles, btCollisionWorld& world, double h);

/// Gives a link an impulse about its centre of mass. A sleeping multibody wakes if that moves the link faster than
/// `still` [m/s], and feels nothing of it otherwise.
void pushLink(btMultiBodyLinkCollider& collider, const Vec6& impulse, double still);

}  // namespace jacket::bullet
