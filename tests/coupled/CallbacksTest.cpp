// Bullet's contact callbacks and manifolds show shells; Bullet's solvers do not respond to them.
#include <BulletCollision/CollisionDispatch/btSimulationIslandManager.h>
#include <BulletDynamics/ConstraintSolver/btNNCGConstraintSolver.h>
#include <BulletDynamics/MLCPSolvers/btDantzigSolver.h>
#include <BulletDynamics/MLCPSolvers/btMLCPSolver.h>
#include <gtest/gtest.h>

#include <functional>
#include <set>

#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

using jacket::testing::contactImpulse;
using jacket::testing::Scene;
using jacket::testing::stateOf;
using jacket::testing::totalMomentum;

/// Bullet's callbacks are global functions: this hands them to whoever is listening.
struct Listener {
    int added = 0, started = 0, processed = 0, ended = 0, destroyed = 0;
    std::function<void(btPersistentManifold&)> onStart, onEnd;
    std::function<void(btManifoldPoint&, btCollisionObject&, btCollisionObject&)> onPoint;
    std::function<void(btManifoldPoint&, const btCollisionObject&, int, const btCollisionObject&)> onAdded;

    Listener() {
        s_current = this;
        gContactAddedCallback = [](btManifoldPoint& point, const btCollisionObjectWrapper* first, int, int index,
                                   const btCollisionObjectWrapper* second, int, int) {
            ++s_current->added;
            if (s_current->onAdded)
                s_current->onAdded(point, *first->getCollisionObject(), index, *second->getCollisionObject());
            return true;
        };
        gContactStartedCallback = [](btPersistentManifold* const& m) {
            ++s_current->started;
            if (s_current->onStart) s_current->onStart(*m);
        };
        gContactEndedCallback = [](btPersistentManifold* const& m) {
            ++s_current->ended;
            if (s_current->onEnd) s_current->onEnd(*m);
        };
        gContactProcessedCallback = [](btManifoldPoint& point, void* first, void* second) {
            ++s_current->processed;
            if (s_current->onPoint)
                s_current->onPoint(point, *static_cast<btCollisionObject*>(first),
                                   *static_cast<btCollisionObject*>(second));
            return true;
        };
        gContactDestroyedCallback = [](void*) {
            ++s_current->destroyed;
            return true;
        };
    }
    ~Listener() {
        gContactAddedCallback = nullptr;
        gContactStartedCallback = nullptr;
        gContactEndedCallback = nullptr;
        gContactProcessedCallback = nullptr;
        gContactDestroyedCallback = nullptr;
    }
    Listener(const Listener&) = delete;
    Listener& operator=(const Listener&) = delete;
    inline static Listener* s_current = nullptr;
};

/// A ball just above a sheet pinned at its border.
struct Trampoline : Scene<> {
    ShellBody* sheet = &shells->add(squareSheet(1, 8), trampolineCloth());
    btRigidBody* ball = &addSphere(0.2, 0.5, btVector3(btScalar(0.03), btScalar(0.21), btScalar(0.02)));
    Trampoline() { pinBorder(*sheet); }
    void removeBall() {
        remove(*ball);
        ball = nullptr;
    }
    void removeSheet() {
        shells->remove(*sheet);
        sheet = nullptr;
    }
    int contactsOf(const btCollisionObject& object) {
        int count = 0;
        for (int i = 0; i < dispatcher.getNumManifolds(); ++i) {
            const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(i);
            if (manifold.getBody0() == &object || manifold.getBody1() == &object) count += manifold.getNumContacts();
        }
        return count;
    }
};

TEST(Callbacks, AContactStartsOnceIsProcessedEveryStepAndEndsOnce) {
    Listener listener;
    Trampoline scene;
    int starts = 0, ends = 0;
    for (int i = 0; i < 120; ++i) {
        const bool before = scene.contactsOf(*scene.ball) > 0;
        const int processed = listener.processed;
        scene.step(1.0 / 120);
        const int points = scene.contactsOf(*scene.ball);
        const int expected = std::min<int>(4, static_cast<int>(scene.sheet->contacts().size()));
        ASSERT_EQ(points, expected) << "step " << i;
        ASSERT_EQ(listener.processed - processed, points) << "step " << i;
        starts += !before && points > 0;
        ends += before && points == 0;
        ASSERT_EQ(listener.started, starts) << "step " << i;
        ASSERT_EQ(listener.ended, ends) << "step " << i;
    }
    EXPECT_GE(starts, 1);
    const bool touching = starts > ends;
    scene.removeBall();
    EXPECT_EQ(listener.ended, ends + touching);
    EXPECT_EQ(scene.dispatcher.getNumManifolds(), 0);
}

TEST(Callbacks, ManifoldsSayWhatTheContactsAre) {
    Trampoline scene;
    for (int i = 0; i < 40 && scene.sheet->contacts().empty(); ++i) scene.step(1.0 / 120);
    scene.run(0.05, 1.0 / 120);
    ASSERT_FALSE(scene.sheet->contacts().empty());
    ASSERT_EQ(scene.dispatcher.getNumManifolds(), 1);
    const btPersistentManifold& manifold = *scene.dispatcher.getManifoldByIndexInternal(0);
    EXPECT_EQ(scene.shells->find(*manifold.getBody0()), scene.sheet);
    EXPECT_EQ(manifold.getBody1(), scene.ball);
    double strongest = 0.0;
    for (const auto& contact : scene.sheet->contacts())
        strongest = std::max(strongest, contact.impulse.dot(contact.contact.normal));
    ASSERT_GT(manifold.getNumContacts(), 0);
    EXPECT_NEAR(manifold.getContactPoint(0).m_appliedImpulse, strongest, 1e-6 * strongest);
    for (int i = 0; i < manifold.getNumContacts(); ++i) {
        const btManifoldPoint& point = manifold.getContactPoint(i);
        const btVector3 centre = scene.ball->getWorldTransform().getOrigin();
        EXPECT_NEAR((point.getPositionWorldOnB() - centre).length(), 0.2, 2e-2);  // as of when it was solved
        EXPECT_GT((point.getPositionWorldOnB() - centre).normalized().dot(point.m_normalWorldOnB), 0.98);
        EXPECT_LT(point.getDistance(), 2e-2);
        EXPECT_LT(
            (point.getPositionWorldOnA() - point.getPositionWorldOnB() - point.getDistance() * point.m_normalWorldOnB)
                .length(),
            1e-6);
        ASSERT_GE(point.m_index0, 0);
        const auto corners = scene.sheet->triangles().col(point.m_index0);
        double nearest = 1.0;
        for (int a = 0; a < 3; ++a)
            nearest =
                std::min(nearest, double((scene.sheet->positions()[corners[a]] - point.m_positionWorldOnA).length()));
        EXPECT_LT(nearest, 0.13);  // an edge is 0.125 m long
        EXPECT_NEAR(point.m_combinedFriction, 0.25, 1e-6);
        if (i > 0) {
            EXPECT_LE(point.m_appliedImpulse, manifold.getContactPoint(i - 1).m_appliedImpulse);
        }
    }
}

/// Data that the user hangs on a point stays while that piece of the shell touches, and is given back once.
TEST(Callbacks, PointsKeepTheUsersData) {
    Listener listener;
    int given = 0, oldest = 0;
    listener.onPoint = [&](btManifoldPoint& point, btCollisionObject&, btCollisionObject&) {
        oldest = std::max(oldest, point.getLifeTime());
        if (point.m_userPersistentData) return;
        ++given;
        point.m_userPersistentData = &listener;
    };
    Trampoline scene;
    scene.run(0.5, 1.0 / 120);
    EXPECT_GT(given, 0);
    EXPECT_GT(oldest, 3);
    scene.removeBall();
    EXPECT_EQ(listener.destroyed, given);
}

enum class When { Start, Point, End };

/// From inside every callback, the body or the shell that touches may be removed and deleted.
class RemovalInside : public ::testing::TestWithParam<std::tuple<When, bool>> {};

TEST_P(RemovalInside, IsSafe) {
    const auto [when, isBody] = GetParam();
    Listener listener;
    Trampoline scene;
    auto& other = scene.shells->add(squareSheet(1, 8), trampolineCloth());  // hears of the same ball
    pinBorder(other);
    bool removed = false;
    const auto act = [&] {
        if (std::exchange(removed, true)) return;
        isBody ? scene.removeBall() : scene.removeSheet();
    };
    if (when == When::Start) listener.onStart = [&](btPersistentManifold&) { act(); };
    if (when == When::Point) listener.onPoint = [&](auto&, auto&, auto&) { act(); };
    if (when == When::End) {
        listener.onEnd = [&](btPersistentManifold&) { act(); };
        listener.onPoint = [&](auto&, auto&, auto&) {  // and off it goes
            scene.ball->setLinearVelocity(btVector3(0, 5, 0));
        };
    }
    scene.run(0.5, 1.0 / 120);
    EXPECT_TRUE(removed);
    EXPECT_EQ(scene.shells->size(), isBody ? 2 : 1);
    EXPECT_EQ(scene.world.getNumCollisionObjects(), 2);
    EXPECT_TRUE(scene.shells->lastStep().finite);
    if (isBody) {
        EXPECT_EQ(scene.dispatcher.getNumManifolds(), 0);
    }
}
INSTANTIATE_TEST_SUITE_P(Cases, RemovalInside,
                         ::testing::Combine(::testing::Values(When::Start, When::Point, When::End), ::testing::Bool()));

TEST(Callbacks, DestroyingTheShellWorldEndsItsContacts) {
    Listener listener;
    Trampoline scene;
    scene.run(0.3, 1.0 / 120);
    ASSERT_GT(scene.contactsOf(*scene.ball), 0);
    scene.shells.reset();
    EXPECT_EQ(listener.started, listener.ended);
    EXPECT_EQ(scene.dispatcher.getNumManifolds(), 0);
}

/// Every solver of Bullet, with islands apart or in one.
class Solvers : public ::testing::TestWithParam<std::tuple<const char*, bool>> {
  protected:
    std::unique_ptr<btConstraintSolver> make() {
        const std::string name = std::get<0>(GetParam());
        if (name == "nncg") return std::make_unique<btNNCGConstraintSolver>();
        if (name == "mlcp") return std::make_unique<btMLCPSolver>(&m_dantzig);
        return std::make_unique<btSequentialImpulseConstraintSolver>();
    }
    bool split() const { return std::get<1>(GetParam()); }

  private:
    btDantzigSolver m_dantzig;
};

/// Were the sheet's manifold a contact to Bullet, it would hold the ball as a static body does.
TEST_P(Solvers, DoNotRespondToShells) {
    const auto solver = make();
    Scene scene(0.0);
    scene.world.setConstraintSolver(solver.get());
    scene.world.getSimulationIslandManager()->setSplitIslands(split());
    auto& ball = scene.addSphere(0.2, 0.7, btVector3(0, btScalar(0.22), 0));
    ball.setLinearVelocity(btVector3(0, -2, 0));
    ball.setAngularVelocity(btVector3(0, 0, 8));
    auto& sheet = scene.shells->add(squareSheet(1, 10), trampolineCloth());
    // A stack of boxes elsewhere, so that the solver has something to do.
    scene.addFloor(-5);
    for (int k = 0; k < 2; ++k)
        scene.addBox(btVector3(btScalar(0.1), btScalar(0.1), btScalar(0.1)), 1.0,
                     btVector3(3, btScalar(0.2 * k - 4.9), 0));
    const Vec3 before = totalMomentum(scene);
    int touching = 0;
    for (int i = 0; i < 30; ++i) {
        scene.step(1.0 / 120);
        touching += !sheet.contacts().empty();
        ASSERT_LT((totalMomentum(scene) - before).norm(), bulletTolerance(1e-9, 2e-6)) << "step " << i;
    }
    EXPECT_GT(touching, 3);
    scene.world.setConstraintSolver(&scene.solver);
}

/// Listening changes nothing.
TEST_P(Solvers, MoveBodiesTheSameWhoeverListens) {
    const auto run = [&] {
        const auto solver = make();
        Scene scene;
        scene.world.setConstraintSolver(solver.get());
        scene.world.getSimulationIslandManager()->setSplitIslands(split());
        scene.addFloor(-0.3);
        auto& sheet = scene.shells->add(squareSheet(1, 8), trampolineCloth());
        pinBorder(sheet);
        for (int k = 0; k < 3; ++k)
            scene.addBox(btVector3(btScalar(0.1), btScalar(0.1), btScalar(0.1)), 0.3,
                         btVector3(btScalar(0.02 * k), btScalar(0.11 + 0.21 * k), 0));
        scene.run(0.4, 1.0 / 120);
        const auto state = stateOf(scene);
        scene.world.setConstraintSolver(&scene.solver);
        return state;
    };
    const auto unheard = run();
    Listener listener;
    EXPECT_EQ(run(), unheard);
    EXPECT_GT(listener.processed, 0);
}
INSTANTIATE_TEST_SUITE_P(Kinds, Solvers,
                         ::testing::Combine(::testing::Values("sequential", "nncg", "mlcp"), ::testing::Bool()));

TEST(Callbacks, ContactsOfASleepingShellStayAndAreNotProcessed) {
    Listener listener;
    Scene<> scene;
    scene.addBox(btVector3(1, 1, 1), 0, btVector3(0, -1, 0));
    TriangleMesh mesh = squareSheet(0.4, 4);
    mesh.positions.row(1).array() += 4e-4;
    auto& sheet = scene.shells->add(mesh, trampolineCloth());
    scene.run(3.0, 1.0 / 60);
    ASSERT_TRUE(sheet.isAsleep());
    const int processed = listener.processed;
    scene.run(0.5, 1.0 / 60);
    EXPECT_EQ(listener.started, 1);
    EXPECT_EQ(listener.ended, 0);
    EXPECT_EQ(listener.processed, processed);
    const btPersistentManifold& manifold = *scene.dispatcher.getManifoldByIndexInternal(0);
    EXPECT_GT(manifold.getNumContacts(), 0);
    sheet.setVelocity(btVector3(0, 2, 0));
    scene.run(0.2, 1.0 / 60);
    EXPECT_EQ(listener.ended, 1);
}

void wantAddedCallback(btCollisionObject& object) {
    object.setCollisionFlags(object.getCollisionFlags() | btCollisionObject::CF_CUSTOM_MATERIAL_CALLBACK);
}

/// A sheet that slides over a floor.
struct Slide : Scene<> {
    btRigidBody& floor = addFloor();
    ShellBody& sheet;
    Slide() : sheet(shells->add(lying(), trampolineCloth(), {.restitution = 0.5})) {
        sheet.setVelocity(btVector3(2, 0, 0));
    }
    static TriangleMesh lying() {
        TriangleMesh mesh = squareSheet(0.4, 4);
        mesh.positions.row(1).array() += 0.5 * trampolineCloth().thickness + 1e-5;
        return mesh;
    }
    double speed() const { return sheet.shell().velocities().row(0).mean(); }
};

TEST(AddedCallback, IsHeardWhereShellOrBodyWantIt) {
    for (const char* who : {"nobody", "shell", "floor"}) {
        Listener listener;
        Slide scene;
        if (*who == 's') wantAddedCallback(scene.sheet.collisionObject());
        if (*who == 'f') wantAddedCallback(scene.floor);
        std::set<int> triangles;
        listener.onAdded = [&](btManifoldPoint& point, const btCollisionObject& first, int index,
                               const btCollisionObject& second) {
            EXPECT_EQ(scene.shells->find(first), &scene.sheet);
            EXPECT_EQ(&second, &scene.floor);
            EXPECT_EQ(index, point.m_index0);
            EXPECT_NEAR(point.m_combinedFriction, 0.25, 1e-6);
            EXPECT_EQ(point.m_combinedRestitution, 0);
            EXPECT_NEAR(point.m_normalWorldOnB.y(), 1, 1e-6);
            triangles.insert(index);
        };
        scene.step(1.0 / 120);
        listener.added = 0;
        scene.step(1.0 / 120);
        if (*who == 'n') {
            EXPECT_EQ(listener.added, 0);
            continue;
        }
        EXPECT_GE(listener.added, scene.sheet.vertexCount());  // of what touches, once each
        const HalfEdgeMesh& mesh = scene.sheet.shell().mesh();
        EXPECT_LE(listener.added, mesh.vertexCount() + int(mesh.edges().size()) + mesh.triangleCount());
        EXPECT_GE(*triangles.begin(), 0);
        EXPECT_GT(triangles.size(), 8u);
    }
}

TEST(AddedCallback, WhatItLeavesAloneKeepsItsBits) {
    const auto run = [](bool isHeard) {
        Listener listener;
        Slide scene;
        if (isHeard) wantAddedCallback(scene.floor);
        scene.run(0.3, 1.0 / 120);
        EXPECT_EQ(listener.added > 0, isHeard);
        return stateOf(scene);
    };
    EXPECT_EQ(run(true), run(false));
}

/// Already in the step of the first touch.
TEST(AddedCallback, ItsFrictionCounts) {
    const auto speedWith = [](btScalar friction) {
        Listener listener;
        Slide scene;
        wantAddedCallback(scene.floor);
        listener.onAdded = [&](btManifoldPoint& point, auto&, int, auto&) { point.m_combinedFriction = friction; };
        scene.run(0.2, 1.0 / 120);
        const btPersistentManifold& manifold = *scene.dispatcher.getManifoldByIndexInternal(0);
        EXPECT_EQ(manifold.getContactPoint(0).m_combinedFriction, friction);
        return scene.speed();
    };
    EXPECT_NEAR(speedWith(0), 2.0, 1e-3);
    EXPECT_NEAR(speedWith(btScalar(0.5)), 2.0 - 0.5 * 9.81 * 0.2, 0.06);
}

/// Ice under one half of a sheet: it turns.
TEST(AddedCallback, SpeaksOfEveryPoint) {
    Listener listener;
    Slide scene;
    wantAddedCallback(scene.floor);
    listener.onAdded = [&](btManifoldPoint& point, auto&, int, auto&) {
        if (point.m_positionWorldOnB.z() > 0) point.m_combinedFriction = 0;
    };
    scene.run(0.15, 1.0 / 120);
    const Points v = scene.sheet.shell().velocities(), x = scene.sheet.shell().positions();
    int least = 0, most = 0;
    x.row(2).minCoeff(&least);
    x.row(2).maxCoeff(&most);
    EXPECT_GT(v(0, most), v(0, least) + 0.1);
}

/// The first hit is the one that matters.
TEST(AddedCallback, ItsRestitutionCounts) {
    Listener listener;
    listener.onAdded = [](btManifoldPoint& point, auto&, int, auto&) { point.m_combinedRestitution = 7; };
    Scene scene;
    wantAddedCallback(scene.addFloor());
    TriangleMesh mesh = squareSheet(0.2, 4);
    mesh.positions.row(1).array() += 0.3;
    const auto& plate = scene.shells->add(mesh, materials::steel(2e-3));
    while (plate.contacts().empty()) scene.step(1.0 / 240);
    scene.run(0.24, 1.0 / 240);
    EXPECT_NEAR(plate.shell().positions().row(1).mean(), 0.3, 0.01);
}

TEST(AddedCallback, GivesBackTheUsersData) {
    Listener listener;
    Slide scene;
    wantAddedCallback(scene.floor);
    listener.onAdded = [&](btManifoldPoint& point, auto&, int, auto&) { point.m_userPersistentData = &listener; };
    scene.run(0.1, 1.0 / 120);
    EXPECT_GT(listener.added, 0);
    EXPECT_EQ(listener.destroyed, listener.added);
}

/// Bullet wakes what a moving contact touches; a shell's manifold is none.
TEST(Callbacks, ManifoldsWakeNobody) {
    Scene scene;
    scene.addFloor(-0.5);
    auto& crate = scene.addBox(btVector3(btScalar(0.5), btScalar(0.5), btScalar(0.5)), 100.0, btVector3(0, 0, 0));
    crate.setActivationState(ISLAND_SLEEPING);
    TriangleMesh mesh = squareSheet(0.8, 8);
    mesh.positions.row(1).array() += 0.501;
    auto& sheet = scene.shells->add(mesh, trampolineCloth());
    scene.run(0.5, 1.0 / 60);
    ASSERT_FALSE(contactImpulse(sheet, crate).isZero(0.0));
    EXPECT_EQ(crate.getActivationState(), ISLAND_SLEEPING);
}

}  // namespace
}  // namespace jacket::bullet::testing
