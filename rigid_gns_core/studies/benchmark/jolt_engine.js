// SPDX-FileCopyrightText: 2026 rigid_gns maintainers
// SPDX-License-Identifier: Apache-2.0

// Jolt for `jolt_engine.py`.

'use strict'

const { serve } = require('./node_engine.js')

const FIXED = 0 // object layers, and those of the broad phase
const MOVING = 1

const load = async (name) => {
  const path = require.resolve(name, { paths: [process.cwd()] })
  const { default: init } = await import(path)
  return init()
}

const makeWorld = (Jolt, scene) => {
  const settings = new Jolt.JoltSettings()
  const count = scene.positions.length
  settings.mMaxBodies = count + scene.planes.length
  settings.mMaxBodyPairs = settings.mMaxContactConstraints = 16 * count + 1024
  const pairs = new Jolt.ObjectLayerPairFilterTable(2)
  pairs.EnableCollision(FIXED, MOVING)
  pairs.EnableCollision(MOVING, MOVING)
  const phases = new Jolt.BroadPhaseLayerInterfaceTable(2, 2)
  for (const layer of [FIXED, MOVING]) {
    phases.MapObjectToBroadPhaseLayer(layer, new Jolt.BroadPhaseLayer(layer))
  }
  settings.mObjectLayerPairFilter = pairs
  settings.mBroadPhaseLayerInterface = phases
  settings.mObjectVsBroadPhaseLayerFilter = new Jolt.ObjectVsBroadPhaseLayerFilterTable(
    phases,
    2,
    pairs,
    2
  )
  const jolt = new Jolt.JoltInterface(settings)
  const system = jolt.GetPhysicsSystem()
  system.SetGravity(new Jolt.Vec3(...scene.gravity))
  const physics = system.GetPhysicsSettings()
  physics.mNumVelocitySteps = scene.velocity_steps
  physics.mNumPositionSteps = scene.position_steps
  physics.mMinVelocityForRestitution = 0
  system.SetPhysicsSettings(physics)
  return { jolt, bodies: system.GetBodyInterface() }
}

const begin = (Jolt, scene) => {
  const { jolt, bodies } = makeWorld(Jolt, scene)
  const unturned = new Jolt.Quat(0, 0, 0, 1)
  const add = (shape, place, turn, layer, { restitution, friction }, change = () => {}) => {
    const type = layer === FIXED ? Jolt.EMotionType_Static : Jolt.EMotionType_Dynamic
    const settings = new Jolt.BodyCreationSettings(
      shape,
      new Jolt.RVec3(...place),
      turn,
      type,
      layer
    )
    settings.mRestitution = restitution
    settings.mFriction = friction
    change(settings)
    const body = bodies.CreateBody(settings)
    bodies.AddBody(body.GetID(), Jolt.EActivation_Activate)
    return body
  }
  for (const plane of scene.planes) {
    const surface = new Jolt.Plane(new Jolt.Vec3(...plane.normal), 0)
    add(new Jolt.PlaneShape(surface, null, 1000), plane.point, unturned, FIXED, plane)
  }
  const ball = new Jolt.SphereShape(scene.radius)
  const spheres = scene.positions.map((place, i) =>
    add(ball, place, new Jolt.Quat(...scene.quaternions[i]), MOVING, scene, (settings) => {
      settings.mOverrideMassProperties = Jolt.EOverrideMassProperties_CalculateInertia
      settings.mMassPropertiesOverride.mMass = scene.mass
      settings.mLinearVelocity = new Jolt.Vec3(...scene.velocities[i])
      settings.mAngularVelocity = new Jolt.Vec3(...scene.angular_velocities[i])
      settings.mLinearDamping = settings.mAngularDamping = 0
    })
  )
  return (places) => {
    for (let k = 0; k < scene.substeps; k += 1) jolt.Step(scene.step, 1)
    spheres.forEach((body, i) => {
      const place = body.GetPosition()
      places.set([place.GetX(), place.GetY(), place.GetZ()], 3 * i)
    })
  }
}

serve(load, begin)
