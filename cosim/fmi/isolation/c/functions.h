/* The functions of FMI that an isolated FMU is asked for, by name: X(name) for each of them. */

#define FMI3_TYPES(X) \
    X(Float32) X(Float64) X(Int8) X(UInt8) X(Int16) X(UInt16) X(Int32) X(UInt32) X(Int64) X(UInt64) X(Boolean)
#define GET3(type) X(fmi3Get##type)
#define SET3(type) X(fmi3Set##type)

#define FUNCTIONS \
    X(fmi2Instantiate) X(fmi2FreeInstance) X(fmi2SetDebugLogging) X(fmi2SetupExperiment) \
    X(fmi2EnterInitializationMode) X(fmi2ExitInitializationMode) X(fmi2Terminate) X(fmi2Reset) \
    X(fmi2GetReal) X(fmi2GetInteger) X(fmi2GetBoolean) X(fmi2GetString) \
    X(fmi2SetReal) X(fmi2SetInteger) X(fmi2SetBoolean) X(fmi2SetString) \
    X(fmi2GetFMUstate) X(fmi2SetFMUstate) X(fmi2FreeFMUstate) X(fmi2SerializedFMUstateSize) \
    X(fmi2SerializeFMUstate) X(fmi2DeSerializeFMUstate) X(fmi2GetDirectionalDerivative) \
    X(fmi2EnterEventMode) X(fmi2NewDiscreteStates) X(fmi2EnterContinuousTimeMode) \
    X(fmi2CompletedIntegratorStep) X(fmi2SetTime) X(fmi2SetContinuousStates) X(fmi2GetDerivatives) \
    X(fmi2GetEventIndicators) X(fmi2GetContinuousStates) X(fmi2GetNominalsOfContinuousStates) \
    X(fmi2SetRealInputDerivatives) X(fmi2GetRealOutputDerivatives) X(fmi2DoStep) X(fmi2CancelStep) \
    X(fmi2GetStatus) X(fmi2GetRealStatus) X(fmi2GetIntegerStatus) X(fmi2GetBooleanStatus) \
    X(fmi2GetStringStatus) \
    X(fmi3InstantiateModelExchange) X(fmi3InstantiateCoSimulation) X(fmi3FreeInstance) \
    X(fmi3SetDebugLogging) X(fmi3EnterInitializationMode) X(fmi3ExitInitializationMode) \
    X(fmi3EnterEventMode) X(fmi3Terminate) X(fmi3Reset) FMI3_TYPES(GET3) FMI3_TYPES(SET3) \
    X(fmi3GetString) X(fmi3SetString) X(fmi3GetBinary) X(fmi3SetBinary) X(fmi3GetClock) X(fmi3SetClock) \
    X(fmi3GetNumberOfVariableDependencies) X(fmi3GetVariableDependencies) \
    X(fmi3GetFMUState) X(fmi3SetFMUState) X(fmi3FreeFMUState) X(fmi3SerializedFMUStateSize) \
    X(fmi3SerializeFMUState) X(fmi3DeserializeFMUState) X(fmi3GetDirectionalDerivative) \
    X(fmi3GetAdjointDerivative) X(fmi3EnterConfigurationMode) X(fmi3ExitConfigurationMode) \
    X(fmi3GetIntervalDecimal) X(fmi3GetIntervalFraction) X(fmi3GetShiftDecimal) X(fmi3GetShiftFraction) \
    X(fmi3SetIntervalDecimal) X(fmi3SetIntervalFraction) X(fmi3SetShiftDecimal) X(fmi3SetShiftFraction) \
    X(fmi3EvaluateDiscreteStates) X(fmi3UpdateDiscreteStates) X(fmi3EnterContinuousTimeMode) \
    X(fmi3CompletedIntegratorStep) X(fmi3SetTime) X(fmi3SetContinuousStates) \
    X(fmi3GetContinuousStateDerivatives) X(fmi3GetEventIndicators) X(fmi3GetContinuousStates) \
    X(fmi3GetNominalsOfContinuousStates) X(fmi3GetNumberOfEventIndicators) \
    X(fmi3GetNumberOfContinuousStates) X(fmi3EnterStepMode) X(fmi3GetOutputDerivatives) X(fmi3DoStep)

#define X(name) F_##name,
enum function { FUNCTIONS N_FUNCTIONS };
#undef X
