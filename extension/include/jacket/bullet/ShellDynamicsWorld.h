#pragma once
#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorld.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <algorithm>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "jacket/bullet/ShellWorld.h"

namespace jacket::bullet {

/// A Bullet world that owns its shells, and does for them what a btActionInterface cannot: kinematic bodies go their
/// way evenly over the substeps of a stepSimulation (Bullet moves them to the end in the first one, and so does this if
/// that isTeleport, unless they came as fast), and shells are drawn between fixed steps as Bullet's motion states are.
/// `Base`: btDiscreteDynamicsWorld or a world derived from it.
template <class Base = btDiscreteDynamicsWorld>
class ShellDynamicsWorld : public Base {
  public:
    using Base::Base;

    ShellWorld& shells() { return m_shells; }
    const ShellWorld& shells() const { return m_shells; }

    /// Vertices of a shell at the time for which Bullet's motion states give the bodies' poses [m]: between the last
    /// two substeps, or ahead of the last one if setLatencyMotionStateInterpolation(false). A shell that has been added
    /// since the last substep is where it stands. Throws std::invalid_argument unless `positions` has the shell's size.
    void renderPositions(const ShellBody& shell, std::span<btVector3> positions) const {
        const auto now = shell.positions();
        if (positions.size() != now.size())
            throw std::invalid_argument("ShellDynamicsWorld::renderPositions: the span must have the shell's size");
        const btScalar step = this->m_fixedTimeStep;
        const auto before = std::find_if(m_before.begin(), m_before.end(),
                                         [&](const auto& entry) { return entry.first == &shell.collisionObject(); });
        if (this->m_latencyMotionStateInterpolation && before == m_before.end()) {
            std::copy(now.begin(), now.end(), positions.begin());
        } else if (this->m_latencyMotionStateInterpolation) {
            const btScalar part = step > btScalar(0) ? this->m_localTime / step : btScalar(1);
            for (std::size_t i = 0; i < now.size(); ++i) positions[i] = before->second[i].lerp(now[i], part);
        } else {
            for (std::size_t i = 0; i < now.size(); ++i)
                positions[i] = now[i] + this->m_localTime * shell.velocity(static_cast<int>(i));
        }
    }

    void removeRigidBody(btRigidBody* body) override {
        std::erase_if(m_motions, [&](const Motion& motion) { return motion.body == body; });
        Base::removeRigidBody(body);
    }

    void removeCollisionObject(btCollisionObject* object) override {
        std::erase_if(m_before, [&](const auto& entry) { return entry.first == object; });  // another may get its place
        Base::removeCollisionObject(object);
    }

  protected:
    void saveKinematicState(btScalar span) override {
        std::swap(m_motions, m_last);
        m_motions.clear();
        for (int i = 0; i < this->m_collisionObjects.size(); ++i) {
            btRigidBody* body = btRigidBody::upcast(this->m_collisionObjects[i]);
            if (body && body->isKinematicObject() && body->getActivationState() != ISLAND_SLEEPING)
                m_motions.push_back(
                    {body, body->getInterpolationWorldTransform(), body->getWorldTransform(), btVector3(0, 0, 0)});
        }
        Base::saveKinematicState(span);  // takes the new poses from the motion states
        for (Motion& motion : m_motions) {
            motion.to = motion.body->getWorldTransform();
            const btVector3 way = motion.to.getOrigin() - motion.from.getOrigin();
            motion.velocity = way / span;
            const bool isJump = isTeleport(*motion.body, double(way.length()), double(span));
            if (isJump && !goesOn(motion)) motion.from = motion.to;
        }
        m_span = span;
        m_elapsed = 0;
    }

    void internalSingleStepSimulation(btScalar h) override {
        m_elapsed += h;
        for (const Motion& motion : m_motions) motion.body->setWorldTransform(motion.at(m_elapsed / m_span));
        m_before.resize(m_shells.size());
        for (int i = 0; i < m_shells.size(); ++i) {
            const auto now = m_shells[i].positions();
            m_before[i].first = &m_shells[i].collisionObject();
            m_before[i].second.assign(now.begin(), now.end());
        }
        Base::internalSingleStepSimulation(h);
    }

  private:
    /// What a kinematic body does during a stepSimulation.
    struct Motion {
        btRigidBody* body;
        btTransform from, to;
        btVector3 velocity;  ///< mean [m/s]
        btTransform at(btScalar part) const {
            if (part > btScalar(1) - btScalar(1e-6)) return to;  // exactly, and not to rounding
            return btTransform(from.getRotation().slerp(to.getRotation(), part),
                               from.getOrigin().lerp(to.getOrigin(), part));
        }
    };
    /// Whether a body has come about as fast as it is to go.
    bool goesOn(const Motion& motion) const {
        const auto before =
            std::find_if(m_last.begin(), m_last.end(), [&](const Motion& last) { return last.body == motion.body; });
        return before != m_last.end() &&
               (motion.velocity - before->velocity).length() < btScalar(0.5) * motion.velocity.length();
    }
    std::vector<Motion> m_motions, m_last;  ///< of this stepSimulation, and of the one before
    btScalar m_span = 0, m_elapsed = 0;
    std::vector<std::pair<const btCollisionObject*, std::vector<btVector3>>> m_before;  ///< positions a substep ago
    ShellWorld m_shells{*this};  ///< last, as it leaves the world first
};

}  // namespace jacket::bullet
