#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "Scene.h"
#include "SceneFile.h"
#include "TemporaryFolder.h"
#include "World.h"

namespace jacket::demo {
namespace {

constexpr const char* kScene = R"({
    // a comment
    "dt": "1/120", "seconds": 0.5,
    "shells": [ { "name": "sheet", "mesh": { "grid": { "size": [1, 1], "cells": [4, 4] } }, "material": "cotton",
                  "pin": [ { "vertices": [0, 4] } ] } ],
    "bodies": [ { "name": "ball", "shape": { "sphere": 0.2 }, "mass": 2, "position": [0, 1, 0] } ],
    "probes": [ { "name": "p", "shell": "sheet", "quantity": "mean_position" } ]
})";

class SceneTest : public testing::Test {
  protected:
    Scene load(const std::string& text, std::vector<std::string> set = {}) {
        return loadScene(m_folder.write("scene.json", text),
                         {.set = std::move(set), .dt = {}, .seconds = {}, .seed = {}});
    }
    /// What is said about a scene with this change, without the file's name.
    std::string complaint(const std::string& set) {
        try {
            load(kScene, {set});
        } catch (const InputError& error) {
            return error.what();
        }
        return "accepted";
    }
    std::string complaintAbout(const std::string& text) {
        try {
            load(text);
        } catch (const InputError& error) {
            std::string message = error.what();
            const std::size_t slash = message.find(m_folder.path().string());
            return slash == 0 ? message.substr(m_folder.path().string().size() + 1) : message;
        }
        return "accepted";
    }
    TemporaryFolder m_folder;
};

TEST_F(SceneTest, ReadsWhatTheFileSays) {
    const Scene scene = load(kScene);
    EXPECT_EQ(scene.name, "scene");
    EXPECT_DOUBLE_EQ(scene.dt, 1.0 / 120);
    EXPECT_EQ(scene.frames(), 60);
    EXPECT_DOUBLE_EQ(scene.gravity.y(), -9.81);
    EXPECT_EQ(scene.bodies.at(0).mass, 2);
    EXPECT_EQ(std::get<std::vector<int>>(scene.shells.at(0).pins.at(0).what), (std::vector{0, 4}));
}

TEST_F(SceneTest, WrittenOutItGivesItselfAgain) {
    const Json written =
        toJson(load(kScene, {"shells.0.membrane.model=baraff-witkin", "shells.0.membrane.shear=12", "wind=[1,2,3]",
                             "shells.0.material={\"preset\":\"paper\",\"yield\":1e7,\"orthotropy\":{\"weft_young\":2e9,"
                             "\"shear\":1e9,\"warp\":[0,0,1]}}",
                             "shells.0.integrator=bdf2", "shells.0.flatten_rest=true", "load_increments=4",
                             "shells.0.sleeping=true", "shells.0.restitution=0.5", "bodies.0.restitution=0.25",
                             "shells.0.clamp=[{\"vertices\":[0,1],\"direction\":[0,0,1]},{\"vertices\":[2,3]}]",
                             "shells.0.guide=[{\"vertices\":[4],\"direction\":[0,1,0]}]",
                             "shells.0.regions=[{\"box\":[[0,0,0],[1,1,1]],\"material\":\"steel\"}]",
                             "shells.0.force=[{\"vertices\":[3],\"total\":[0,1,0]}]"}));
    EXPECT_EQ(toJson(load(written.dump())), written);
}

constexpr const char* kMultiBody =
    R"(multibodies=[{"name":"arm","base":{"shape":{"box":[1,1,1]},"position":[0,2,0]},"links":[)"
    R"({"name":"slide","shape":{"sphere":0.1},"mass":1,"position":[0,1.5,0],"joint":{"prismatic":[0,2,0]},)"
    R"("motor":[{"velocity":1,"max_force":5,"until":1},{"velocity":-1,"max_force":4}],"limits":[-0.5,0]},)"
    R"({"name":"hand","parent":"slide","shape":{"sphere":0.1},"mass":1,"position":[1,1.5,0],"pivot":[0.5,1.5,0],)"
    R"("joint":{"revolute":[0,0,1]}},)"
    R"({"name":"nail","parent":"hand","shape":{"sphere":0.1},"mass":1,"joint":{"fixed":true}}]}])";

TEST_F(SceneTest, LinksOfMultiBodiesAreBodies) {
    const Scene scene = load(kScene, {kMultiBody, R"(probes.0={"name":"p","body":"hand","quantity":"velocity"})"});
    ASSERT_EQ(scene.bodies.size(), 5u);
    EXPECT_EQ(scene.bodies[1].name, "arm");
    EXPECT_EQ(scene.probes[0].body, 3);
    const MultiBodyDescription& arm = scene.multiBodies.at(0);
    EXPECT_EQ(arm.base, 1);
    EXPECT_EQ(arm.links[0].joint.axis, Vec3(0, 1, 0));
    EXPECT_EQ(arm.links[0].joint.motor.at(1).maxForce, 4);
    EXPECT_EQ(arm.links[1].parent, 0);
    EXPECT_EQ(arm.links[1].joint.pivot, Vec3(0.5, 1.5, 0));
    EXPECT_EQ(arm.links[2].joint.kind, Joint::Kind::Fixed);
    const Json written = toJson(scene);
    EXPECT_EQ(written["bodies"].size(), 1u);
    EXPECT_EQ(toJson(load(written.dump())), written);
}

/// Normalising a vector of length 1 anew changes its last bits in one case of five.
TEST_F(SceneTest, DirectionsOfAnyLengthKeepTheirBitsOnceTheyAreWritten) {
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> exponent(-6, 6);
    Json scene = parseJson(kScene, "scene.json");
    Json& links =
        (scene["multibodies"] = parseJson(R"([{"base":{"shape":{"sphere":0.1}},"links":[]}])", ""))[0]["links"];
    for (int i = 0; i < 500; ++i) {
        const double scale = std::pow(10.0, exponent(random));
        const Json direction = toJson(scale * Vec3(normal(random), normal(random), normal(random)));
        Json plane = direction;
        plane.push_back(normal(random));
        scene["bodies"].push_back({{"shape", {{"plane", plane}}}});
        for (const char* key : {"guide", "clamp"})
            scene["shells"][0][key].push_back({{"vertices", {0}}, {"direction", direction}});
        links.push_back({{"name", "link" + std::to_string(i)}, {"shape", {{"sphere", 0.1}}}, {"mass", 1}});
        links.back()["joint"] = {{i % 2 == 0 ? "prismatic" : "revolute", direction}};
    }
    const Scene read = load(scene.dump());
    EXPECT_NEAR(std::get<Plane>(read.bodies.at(1).shape).normal.norm(), 1.0, 1e-15);
    const Json written = toJson(read);
    EXPECT_EQ(toJson(load(written.dump())), written);
}

TEST_F(SceneTest, MistakesInMultiBodiesAreNamed) {
    const std::pair<const char*, const char*> cases[] = {
        {"multibodies.0.link=1", "multibodies.0.link: unknown key \"link\"; did you mean \"links\"?"},
        {"multibodies.arm.links.slide.motr=1", "unknown key \"motr\"; did you mean \"motor\"?"},
        {"multibodies.0.links.1.parent=slid", "has the unknown value \"slid\"; did you mean \"slide\"?"},
        {"multibodies.0.links.0.parent=hand", "multibodies.0.links.0.parent has the unknown value"},  // comes later
        {"multibodies.0.links.0.mass=0", "multibodies.0.links.0.mass [kg] must be > 0, got 0"},
        {"multibodies.0.links.0.joint={\"prismatic\":[0,0,0]}",
         "multibodies.0.links.0.joint.prismatic must be an axis"},
        {"multibodies.0.links.0.joint={\"ball\":true}", "unknown key \"ball\""},
        {"multibodies.0.links.2.limits=[-1,1]", "multibodies.0.links.2.joint is fixed"},
        {"multibodies.0.links.0.limits=[0.1,1]", "multibodies.0.links.0.limits must be [low <= 0, high >= 0]"},
        {"multibodies.0.links.0.motor.1.until=0.5", "must not be before the phase that precedes it ends"},
        {"multibodies.0.base.shape={\"plane\":[0,1,0,0]}", "is a plane, which cannot be jointed"},
        {"multibodies.0.name=ball", "two bodies are called \"ball\""},
    };
    const std::string whole = toJson(load(kScene, {kMultiBody})).dump();
    for (const auto& [set, expected] : cases) {
        std::string message = "accepted";
        try {
            load(whole, {set});
        } catch (const InputError& error) {
            message = error.what();
        }
        EXPECT_NE(message.find(expected), std::string::npos) << set << "\n  " << message;
    }
}

TEST_F(SceneTest, SetReplacesValuesByIndexAndByName) {
    const Scene scene =
        load(kScene, {"shells.sheet.friction=0.1", "bodies.0.mass=3", "shells.0.material.thickness=0.002",
                      "shells.0.mesh.grid.cells.1=7", "shells.0.bending=quadratic", "shells.0.restitution=0.5",
                      "bodies.0.restitution=0.25"});
    EXPECT_EQ(scene.shells[0].friction, 0.1);
    EXPECT_EQ(scene.shells[0].restitution, 0.5);
    EXPECT_EQ(scene.bodies[0].restitution, 0.25);
    EXPECT_EQ(scene.bodies[0].mass, 3);
    EXPECT_EQ(scene.shells[0].material.thickness, 0.002);
    EXPECT_EQ(std::get<GridOptions>(scene.shells[0].mesh).cells, Eigen::Vector2i(4, 7));
    EXPECT_TRUE(std::holds_alternative<QuadraticBending>(scene.shells[0].bending));
}

TEST_F(SceneTest, EveryMistakeIsNamedWithItsPath) {
    const std::pair<const char*, const char*> cases[] = {
        {"shells.0.material.thickness=-0.001",
         "--set shells.0.material.thickness=-0.001: shells.0.material.thickness [m] must be > 0, got -0.001"},
        {"shells.sheet.frixion=1", "unknown key \"frixion\"; did you mean \"friction\"?"},
        {"shell.0.friction=1", "unknown key \"shell\"; did you mean \"shells\"?"},
        {"shells.sheat.friction=1", "shells has no element \"sheat\": it has one element, 0; did you mean \"sheet\"?"},
        {"shells.4.friction=1", "shells has no element \"4\": it has one element, 0"},
        {"shells.0.name.x=1", "shells.0.name is \"sheet\" and has no \"x\" in it"},
        {"shells.0.friction=rough", "shells.0.friction must be a number, got \"rough\""},
        {"bodies.0.restitution=1.5", "bodies.0.restitution must be >= 0 and <= 1, got 1.5"},
        {"shells.0.material=cottn", "unknown material \"cottn\"; did you mean \"cotton\"?"},
        {"shells.0.bending=quadratc", "unknown model \"quadratc\"; did you mean \"quadratic\"?"},
        {"shells.0.membrane={\"model\":\"stvk\",\"shear\":1}", "shells.0.membrane.shear: unknown key \"shear\""},
        {"shells.0.pin.0.vertices=[1,-2]", "shells.0.pin.0.vertices.1 must be a vertex index >= 0, got -2"},
        {"shells.0.pin.0.box=[[0,0,0],[1,1,1]]", "has both \"box\" and \"vertices\""},
        {"shells.0.mesh={}", "shells.0.mesh must have one of \"file\", \"grid\", \"hemisphere\", \"cylinder\""},
        {"shells.0.mesh={\"file\":\"none.obj\"}", "shells.0.mesh.file: there is no file"},
        {"shells.0.mesh.grid.cells=[3,0]", "shells.0.mesh.grid.cells.1 must be >= 1 and <= 10000, got 0"},
        {"bodies.0.shape={\"box\":[1,1]}", "bodies.0.shape.box must be a list of 3 numbers, got [1,1]"},
        {"bodies.0.shape={\"sphere\":0}", "bodies.0.shape.sphere [m] must be > 0, got 0"},
        {"bodies.0.shape={\"mesh\":\"none.obj\"}", "bodies.0.shape.mesh: there is no file"},
        {"bodies.0.shape={\"compound\":[]}", "bodies.0.shape.compound must have at least one part"},
        {"bodies.0.shape={\"compound\":[{\"box\":[1,1]}]}",
         "bodies.0.shape.compound.0.box must be a list of 3 numbers"},
        {"bodies.0.shape={\"compound\":[{\"plane\":[0,1,0,0]}]}", "bodies.0.shape.compound.0.plane is endless"},
        {"bodies.0.mass=0", "accepted"},
        {"bodies.0={\"shape\":{\"sphere\":1},\"velocity\":[1,0,0]}", "bodies.0.velocity needs a mass > 0"},
        {"bodies.0.kinematic={\"velocity\":[1,0,0]}", "bodies.0.kinematic needs mass 0"},
        {"probes.0.quantity=speed", "has the unknown value \"speed\"; did you mean"},
        {"probes.0.shell=shet", "probes.0.shell has the unknown value \"shet\"; did you mean \"sheet\"?"},
        {"probes=[{\"name\":\"p\",\"shell\":\"sheet\",\"quantity\":\"reaction\"},"
         "{\"name\":\"p\",\"body\":\"ball\",\"quantity\":\"position\"}]",
         "probes.1.name: two probes are called \"p\""},
        {"shells.0.material.yield=0", "shells.0.material.yield [Pa] must be > 0, got 0"},
        {"shells.0.material.hardening=-1", "shells.0.material.hardening [Pa] must be >= 0, got -1"},
        {"shells.0.material.orthotropy={\"weft_young\":1e9}", "shells.0.material.orthotropy.shear is missing"},
        {"shells.0.material.orthotropy={\"weft_young\":1e9,\"shear\":1e5,\"warp\":[0,0,0]}",
         "shells.0.material.orthotropy.warp must be a direction"},
        {"shells.0.material.orthotropy={\"weft_young\":1e12,\"shear\":1e5}",
         "shells.0.material.orthotropy must be positive definite"},
        {"shells.0.integrator=bdf3", "shells.0.integrator has the unknown value \"bdf3\"; did you mean \"bdf2\"?"},
        {"mode=satic", "mode has the unknown value \"satic\"; did you mean \"static\"?"},
        {"load_increments=0", "load_increments must be >= 1"},
        {"load_increments=1000001", "load_increments must be <= 1000000, got 1000001"},
        {"substeps=2147483647", "substeps must be <= 1000000, got 2147483647"},
        {"substeps=1000000", "accepted"},
        {"shells.0.clamp=[{\"vertices\":[0,1],\"direction\":[0,0,0]}]", "shells.0.clamp.0.direction must not be zero"},
        {"shells.0.guide=[{\"vertices\":[0]}]", "shells.0.guide.0.direction is missing"},
        {"shells.0.regions=[{\"vertices\":[0],\"material\":\"steel\"}]", "regions are boxes"},
        {"dt=0", "dt [s] must be > 0, got 0"},
        {"dt=1/0", "dt [s] must be a number > 0 or a fraction"},
        {"gravity=[0,1]", "gravity must be a list of 3 numbers"},
        {"shells=[]", "shells must have at least one shell"},
        {"x", "must be path=value"},
        {"shells..x=1", "the path has an empty part"},
    };
    for (const auto& [set, expected] : cases)
        EXPECT_NE(complaint(set).find(expected), std::string::npos) << set << "\n  " << complaint(set);
}

TEST_F(SceneTest, MeshesAreBodiesThatStand) {
    m_folder.write("roof.obj", "v -1 0 0\nv 0 0 1\nv 1 0 0\nv 0 1 0\nf 1 2 4\nf 2 3 4\n");
    const char* shape = "bodies.0.shape={\"compound\":[{\"mesh\":\"roof.obj\",\"position\":[0,1,0]},{\"sphere\":1}]}";
    EXPECT_NE(complaint(shape).find("needs mass 0; use \"hull\" for moving bodies"), std::string::npos)
        << complaint(shape);
    const Scene scene = load(kScene, {"bodies.0.mass=0", shape});
    const auto& parts = std::get<Compound>(scene.bodies[0].shape).parts;
    ASSERT_EQ(parts.size(), 2u);
    EXPECT_EQ(parts[0].transform.position.y(), 1);
    EXPECT_EQ(toJson(load(toJson(scene).dump())), toJson(scene));
    EXPECT_NO_THROW(World{scene});
    m_folder.write("roof.obj", "v -1 0 0\nv 0 0 0\nv 1 0 0\nf 1 2 3\n");
    EXPECT_THROW(World{scene}, InputError);
}

/// A dumb-bell of two unequal balls on a rod turns about its centre of mass, wherever that is in its own frame.
TEST_F(SceneTest, ACompoundTurnsAboutItsCentreOfMass) {
    const Scene scene = load(kScene, {"gravity=[0,0,0]",
                                      "bodies.0={\"shape\":{\"compound\":[{\"sphere\":0.1,\"position\":[1,0,0]},"
                                      "{\"sphere\":0.2,\"position\":[-1,0,0]}]},\"mass\":9,\"position\":[0,5,0],"
                                      "\"rotation_deg\":[0,0,30],\"angular_velocity\":[0,0,2]}",
                                      "probes=[]"});
    World world(scene);
    const auto start = world.bodies()[0];
    EXPECT_LT((start.position - Vec3(0, 5, 0)).norm(), 1e-6);
    EXPECT_LT((start.rotation - scene.bodies[0].transform.rotation()).norm(), 1e-6);
    const Vec3 centre = Vec3(0, 5, 0) + scene.bodies[0].transform.rotation() * Vec3(-7.0 / 9, 0, 0);  // 1 kg and 8 kg
    EXPECT_LT((start.centre - centre).norm(), 1e-6);
    const double alongRod = 0.4 * (1 * 0.01 + 8 * 0.04), across = alongRod + 8.0 / 9 * 4;
    EXPECT_LT((start.inertia - Vec3(alongRod, across, across).asDiagonal().toDenseMatrix()).norm(), 1e-5);
    for (int i = 0; i < 30; ++i) world.step();
    const auto end = world.bodies()[0];
    EXPECT_LT((end.centre - centre).norm(), 1e-6);
    EXPECT_NEAR(std::atan2(end.rotation(1, 0), end.rotation(0, 0)), 30 * M_PI / 180 + 0.5, 1e-3);
}

/// A shell sleeps only together with the body that it carries, so this says that the body may sleep, too.
TEST_F(SceneTest, ShellsAndBodiesSleepOnlyIfTheSceneSaysSo) {
    const std::vector<std::string> resting{
        "dt=1/60", "shells.0.pin=[]",
        "bodies=[{\"shape\":{\"box\":[0.4,0.2,0.4]},\"mass\":2,\"position\":[0,0.102,0]},"
        "{\"shape\":{\"plane\":[0,1,0,0]}}]",
        "shells.0.transform={\"position\":[0,0.001,0]}", "shells.0.material=rubber"};
    for (const bool sleeping : {false, true}) {
        auto changes = resting;
        if (sleeping) changes.push_back("shells.0.sleeping=true");
        World world(load(kScene, changes));
        for (int i = 0; i < 240; ++i) world.step();
        EXPECT_EQ(world.isAsleep(0), sleeping);
    }
}

TEST_F(SceneTest, WhatIsNotThereYetIsRefused) {
    const std::pair<const char*, const char*> cases[] = {
        {"shells.0.self_collision=true", "self-collision is not available yet"},
    };
    for (const auto& [set, expected] : cases) {
        EXPECT_THROW(load(kScene, {set}), NotAvailable) << set;
        EXPECT_NE(complaint(set).find(expected), std::string::npos) << complaint(set);
    }
    EXPECT_NO_THROW(load(kScene, {"shells.0.self_collision=false", "mode=dynamic"}));
}

TEST_F(SceneTest, SyntaxErrorsNameFileLineAndColumn) {
    EXPECT_EQ(complaintAbout("{\n  \"dt\": 0.1,\n  \"seconds\" 1\n}").substr(0, 17), "scene.json:3:13: ");
    EXPECT_NE(complaintAbout("{\"dt\": 1, \"dt\": 2}").find("the key \"dt\" is given twice"), std::string::npos);
    EXPECT_NE(complaintAbout("{\"dt\": 1e999}").find("scene.json: not valid JSON"), std::string::npos);
    EXPECT_NE(complaintAbout("[1]").find("must be an object {...}, got [1]"), std::string::npos);
    EXPECT_NE(complaintAbout("").find("scene.json:1:1: not valid JSON"), std::string::npos);
}

TEST_F(SceneTest, SelectionsThatSelectNothingAreErrors) {
    Points x = Points::Zero(3, 2);
    x.col(1) << 1, 2, 3;
    const Selection box{Selection::Bounds{{5, 5, 5}, {6, 6, 6}}, "scene.json: shells.0.pin.0"};
    try {
        box.vertices(x);
        FAIL();
    } catch (const InputError& error) {
        EXPECT_STREQ(error.what(),
                     "scene.json: shells.0.pin.0.box selects no vertex: it reaches from [5, 5, 5] to "
                     "[6, 6, 6], the shell from [0, 0, 0] to [1, 2, 3]");
    }
    EXPECT_THROW((Selection{std::vector{2}, ""}.vertices(x)), InputError);
    EXPECT_EQ((Selection{std::vector{1, 0, 1}, ""}.vertices(x)), (std::vector{0, 1}));
}

TEST(BundledScenes, CanBeRead) {
    const auto scenes = bundledScenes();
    EXPECT_GE(scenes.size(), 8u);
    for (const auto& file : scenes) {
        EXPECT_FALSE(sceneDescription(file).empty()) << file;
        EXPECT_NO_THROW(loadScene(file)) << file;
    }
    EXPECT_THROW(findScene("trampolin"), InputError);
}

}  // namespace
}  // namespace jacket::demo
